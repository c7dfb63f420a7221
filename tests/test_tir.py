import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import models
from twin.errors import TwinError
from twin.tyre.record import TYRE_DTYPE
from twin.tyre.tir import LARGEST_FILE, read_tyre
from twin.tyre.tir_keys import REQUIRED, SCALING

SUV = models.path("tyres/suv.tir").read_text()


@pytest.fixture
def folder(tmp_path):
    """A function that writes a text or bytes as a tyre file and returns its path."""

    def write(content):
        path = tmp_path / "tyre.tir"
        path.write_bytes(content if isinstance(content, bytes) else content.encode())
        return path

    return write


def changed(key, value, text=SUV):
    """The SUV's file with another value of one key; None leaves its line out."""
    lines = []
    for line in text.splitlines():
        if line.partition("=")[0].strip() == key:
            line = None if value is None else f"{key} = {value}"
        lines += [] if line is None else [line]
    assert lines != text.splitlines(), f"no key {key} to change"
    return "\n".join(lines)


def refusal(path):
    with pytest.raises(TwinError) as caught:
        read_tyre(path)
    message = str(caught.value)
    assert str(path) in message
    assert "\n" not in message
    return message


def test_numbers_are_those_of_the_file():
    tyre = read_tyre(models.path("tyres/suv.tir"))
    assert tyre.dtype == TYRE_DTYPE
    assert tyre["pky1"] == -18.5
    assert tyre["fnomin"] == 6000.0
    assert tyre["qbz9"] == 8.0
    assert tyre["fzmax"] == 15000.0
    assert tyre["cammax"] == 0.2618
    assert tyre["side"] == 1.0


def test_every_key_of_the_file_lands_in_its_field(folder):
    keys = [key for keys in (*REQUIRED.values(), SCALING) for key in keys]
    tyre = read_tyre(folder(SUV))
    for line in SUV.splitlines():
        key, equals, value = line.partition("=")
        if equals and key.strip() in keys:
            assert tyre[key.strip().lower()] == float(value.split("$")[0]), key
            keys.remove(key.strip())
    assert keys == []


def test_case_quotes_comments_and_blank_lines_do_not_matter(folder):
    text = SUV.lower().replace("'", '"').replace("\n", "  ! a remark = 3 $ 'more\r\n\r\n")
    assert read_tyre(folder(text)) == read_tyre(folder(SUV))


def test_comment_sign_in_quotes_is_no_comment(folder):
    assert "'$LEFT'" in refusal(folder(changed("TYRESIDE", "'$LEFT'")))


def test_unknown_sections_and_keys_are_passed_over(folder):
    text = SUV.replace("[DIMENSION]", "[SHAPE]\n{radial width}\n1.0 0.0\n[DIMENSION]\nRIM_WIDTH=1")
    assert read_tyre(folder(text)) == read_tyre(folder(SUV))


def test_missing_scaling_factor_is_one(folder):
    assert read_tyre(folder(changed("LMUX", None)))["lmux"] == 1.0


def test_missing_ranges_have_defaults(folder):
    head, _, rest = SUV.partition("[LONG_SLIP_RANGE]")
    tyre = read_tyre(folder(head + rest[rest.index("[SCALING") :]))
    assert tyre["fzmin"] == 120.0
    assert tyre["fzmax"] == 18000.0
    assert tyre["cammax"] == pytest.approx(0.2618, abs=1e-4)


def test_right_hand_tyre_has_side_minus_one(folder):
    assert read_tyre(folder(changed("TYRESIDE", "'Right'")))["side"] == -1.0


@pytest.mark.parametrize("model", ["6", "52", "'PAC2002'", "'pac2002'"])
def test_names_of_the_magic_formula_5_2_are_accepted(folder, model):
    assert read_tyre(folder(changed("FITTYP", model))) == read_tyre(folder(SUV))


def test_model_without_fittyp_is_named_by_the_file_format(folder):
    assert read_tyre(folder(changed("FITTYP", None))) == read_tyre(folder(SUV))
    text = changed("PROPERTY_FILE_FORMAT", "'FTIRE'", changed("FITTYP", None))
    assert "PROPERTY_FILE_FORMAT = 'FTIRE'" in refusal(folder(text))


@pytest.mark.parametrize("model", ["60", "'MF-SWIFT'", "21"])
def test_other_models_are_named_in_the_error(folder, model):
    message = refusal(folder(changed("FITTYP", model)))
    assert model.strip("'") in message
    assert "6, 52, PAC2002 (all MF 5.2), 61, 62 (MF 6.1 and 6.2)" in message


@pytest.mark.parametrize(
    ("key", "unit", "allowed"),
    [
        ("LENGTH", "mm", "meter"),
        ("FORCE", "kN", "newton"),
        ("ANGLE", "degrees", "radian"),
        ("MASS", "slug", "kg"),
        ("TIME", "ms", "second"),
    ],
)
def test_units_that_are_not_si_are_refused(folder, key, unit, allowed):
    message = refusal(folder(changed(key, f"'{unit}'")))
    assert f"[UNITS] {key} = '{unit}'" in message
    assert allowed in message


def test_missing_file_and_folder_are_refused(tmp_path):
    assert "No such file" in refusal(tmp_path / "none.tir")
    assert "cannot read" in refusal(tmp_path)


def test_file_name_with_a_null_character_is_refused():
    with pytest.raises(TwinError, match="cannot read"):
        read_tyre("a\0b.tir")


def test_large_file_is_refused(folder):
    assert "larger than" in refusal(folder(SUV + "$" * LARGEST_FILE))


@pytest.mark.parametrize("section", ["UNITS", "MODEL", *REQUIRED])
def test_missing_section_is_named(folder, section):
    assert f"[{section}] is missing" in refusal(folder(SUV.replace(f"[{section}]", "[OTHER]")))


@pytest.mark.parametrize("key", [key for keys in REQUIRED.values() for key in keys])
def test_missing_coefficient_is_named(folder, key):
    assert f"{key} is missing" in refusal(folder(changed(key, None)))


@pytest.mark.parametrize("value", ["", "fast", "1,5", "nan", "inf", "-1e99", "1.0 2.0", "0x10"])
def test_value_that_is_no_sound_number_is_refused(folder, value):
    message = refusal(folder(changed("PEY1", value)))
    assert f"[LATERAL_COEFFICIENTS] PEY1 = {value!r}" in message
    assert "allowed is a number from" in message


@pytest.mark.parametrize(
    ("key", "value"),
    [("FNOMIN", "0"), ("UNLOADED_RADIUS", "-0.3"), ("LKY", "0"), ("PCX1", "0"), ("PKY2", "-1.9")],
)
def test_value_that_makes_no_tyre_is_refused(folder, key, value):
    assert f"{key} = {value!r}" in refusal(folder(changed(key, value)))


def test_other_sign_convention_is_refused(folder):
    assert "ISO-W" in refusal(folder(changed("PKY1", "18.5")))


def test_range_upside_down_is_refused(folder):
    assert "[SLIP_ANGLE_RANGE] ALPMIN" in refusal(folder(changed("ALPMAX", "-2")))


def test_load_range_below_the_nominal_load_is_refused(folder):
    assert "FZMAX = 5000" in refusal(folder(changed("FZMAX", "5000")))


def test_key_given_twice_is_refused(folder):
    text = SUV.replace("PDX1 ", "PDX1 = 2.0\nPDX1 ")
    assert "'PDX1' is given twice" in refusal(folder(text))


def test_line_that_is_no_assignment_is_refused(folder):
    text = SUV.replace("[VERTICAL]", "[VERTICAL]\nnonsense")
    number = text.split("\n").index("nonsense") + 1
    message = refusal(folder(text))
    assert f"line {number}: 'nonsense' in [VERTICAL] is not KEY = value" in message


def test_comment_may_hold_any_byte(folder):
    remark = b"$ 25 \xb0C \x85 \x0b \xff\n"
    assert read_tyre(folder(remark.join(SUV.encode().splitlines(True)))) == read_tyre(folder(SUV))


def outcome(path):
    """Whether a file is a tyre; anything but a tyre or a TwinError fails the test."""
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        try:
            tyre = read_tyre(path)
        except TwinError as error:
            return len(str(error).splitlines()) == 1
        return all(np.isfinite(tyre[name]) for name in TYRE_DTYPE.names)


@settings(deadline=None, max_examples=200)
@given(content=st.binary(max_size=2000))
def test_random_bytes_end_in_one_line_of_error(tmp_path_factory, content):
    path = tmp_path_factory.getbasetemp() / "random.tir"
    path.write_bytes(content)
    assert outcome(path)


@settings(deadline=None, max_examples=200)
@given(start=st.integers(0, len(SUV) - 1), length=st.integers(0, 80), patch=st.binary(max_size=40))
def test_damaged_file_is_a_tyre_or_one_line_of_error(tmp_path_factory, start, length, patch):
    content = SUV.encode()
    path = tmp_path_factory.getbasetemp() / "damaged.tir"
    path.write_bytes(content[:start] + patch + content[start + length :])
    assert outcome(path)
