import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import models
from scenarios.__main__ import main
from twin.errors import TwinError, TwinWarning
from twin.tyre.magic_formula import magic_formula, relaxation_lengths, slip_stiffnesses
from twin.tyre.record import TYRE_DTYPE
from twin.tyre.tir import read_tyre
from twin.tyre.tir_keys import DEFAULTS, REQUIRED, SCALING
from twin.tyre.tir_text import LARGEST_FILE

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


def test_what_says_nothing_about_forces_is_passed_over(folder):
    text = SUV.replace("[DIMENSION]", "[SHAPE]\n{radial width}\n1.0 0.0\n[DIMENSION]\nRIM_WIDTH=1")
    assert read_tyre(folder(text)) == read_tyre(folder(SUV))


def put(section, *lines, text=SUV):
    """The SUV's file with more lines in a section, which is appended if it is new."""
    if f"[{section}]" not in text:
        text += f"[{section}]\n"
    return text.replace(f"[{section}]\n", "\n".join([f"[{section}]", *lines, ""]), 1)


@pytest.mark.parametrize(
    ("text", "named"),
    [
        (put("SCALING_COEFFICIENTS", "LMYU = 0.5"), "[SCALING_COEFFICIENTS] LMYU"),
        (SUV.replace("[SCALING_COEFFICIENTS]", "[SCALING_COEFFICIENT]"), "[SCALING_COEFFICIENT]"),
        (put("LATERAL_COEFFICIENTS", "PEY5 = 0.3"), "[LATERAL_COEFFICIENTS] PEY5"),
        (put("BOTTOMING_CURVE", "{pen fz}", "0 0"), "[BOTTOMING_CURVE]"),
        (put("VERTICAL", "Q_V2 = 0.05", "Q_FCX = 0.1"), "[VERTICAL] Q_V2, [VERTICAL] Q_FCX"),
    ],
)
def test_what_is_not_used_is_named(folder, text, named):
    with pytest.warns(TwinWarning) as caught:
        tyre = read_tyre(folder(text))
    (warning,) = caught
    assert str(warning.message).endswith(f"not used: {named}")
    assert tyre == read_tyre(folder(SUV))


def test_key_without_effect_is_not_named(folder):
    text = put("LATERAL_COEFFICIENTS", "PEY5 = 0.0", text=put("SCALING_COEFFICIENTS", "LGYR = 1"))
    assert read_tyre(folder(text)) == read_tyre(folder(SUV))


def test_many_unused_keys_are_named_in_one_line(folder):
    text = put("VERTICAL", *(f"Q_FZ{number} = 1" for number in range(100)))
    with pytest.warns(TwinWarning, match=r"Q_FZ11 and 88 more$"):
        read_tyre(folder(text))


def test_vertical_stiffness_has_a_factor(folder):
    tyre = read_tyre(folder(put("SCALING_COEFFICIENTS", "LCZ = 0.5")))
    assert tyre["vertical_stiffness"] == 130_000.0


PRESSURE = ("LONGITUDINAL_COEFFICIENTS", "PPX1 = -0.4"), ("LATERAL_COEFFICIENTS", "PPY1 = 0.4")


@pytest.mark.parametrize(
    ("section", "names"),
    [("TIRE_CONDITIONS", ("IP", "IP_NOM")), ("OPERATING_CONDITIONS", ("INFLPRES", "NOMPRES"))],
)
def test_inflation_pressure_changes_the_stiffnesses(folder, section, names):
    text = put(section, f"{names[0]} = 200000", f"{names[1]} = 250000")
    for place, line in PRESSURE:
        text = put(place, line, text=text)
    changed_, plain = read_tyre(folder(text)), read_tyre(folder(SUV))
    ratio = np.divide(slip_stiffnesses(changed_, 6000.0, 0.0), slip_stiffnesses(plain, 6000.0, 0.0))
    np.testing.assert_allclose(ratio, (1.0 - 0.4 * -0.2, 1.0 + 0.4 * -0.2), rtol=1e-12)


def test_pressure_in_another_unit_is_refused(folder):
    text = put("UNITS", "PRESSURE = 'bar'", text=put("TIRE_CONDITIONS", "IP = 2000"))
    assert "[UNITS] PRESSURE = 'bar', only 'pascal'" in refusal(folder(text))


def test_straight_load_curve_gives_the_vertical_stiffness(folder):
    text = put("DEFLECTION_LOAD_CURVE", "{pen fz}", "0.00 0", "0.02 2600", "0.05 6500")
    assert read_tyre(folder(text))["vertical_stiffness"] == pytest.approx(130_000.0)
    text = changed("VERTICAL_STIFFNESS", None, text)
    assert read_tyre(folder(text))["vertical_stiffness"] == pytest.approx(130_000.0)


def test_load_curve_is_right_at_the_nominal_load_and_says_how_bent_it_is(folder):
    rows = [f"{depth} {2e5 * depth + 2e6 * depth**2}" for depth in np.arange(0.0, 0.06, 0.01)]
    with pytest.warns(TwinWarning, match="straight line of .*% of FNOMIN off elsewhere"):
        tyre = read_tyre(folder(put("DEFLECTION_LOAD_CURVE", *rows)))
    depth = 6000.0 / tyre["vertical_stiffness"]
    assert 2e5 * depth + 2e6 * depth**2 == pytest.approx(6000.0, rel=0.01)


@pytest.mark.parametrize(
    ("rows", "message"),
    [
        (("0 0", "0.02 x"), "has a row '0.02 x'"),
        (("0 0", "0 100"), "has a row '0 100', allowed are rising numbers"),
        (("0 0", "0.01 100"), "does not reach FNOMIN"),
        (("-1 0", "-0.5 9000"), "no positive deflection"),
    ],
)
def test_load_curve_that_is_none_is_refused(folder, rows, message):
    assert message in refusal(folder(put("DEFLECTION_LOAD_CURVE", *rows)))


def test_more_terms_of_the_overturning_moment_are_used(folder):
    """PAC2002 from Adams 2005 on: R_0 F_z q_Sx4 cos(...) sin(...) + q_Sx10 arctan(...) gamma."""
    keys = {"QSX4": 0.05, "QSX5": 0.4, "QSX6": 0.9, "QSX7": 1.0, "QSX8": 2.0, "QSX9": 1.5}
    keys |= {"QSX10": 0.3, "QSX11": 0.7}
    text = put("OVERTURNING_COEFFICIENTS", *(f"{key} = {value}" for key, value in keys.items()))
    slip = (7000.0, 0.02, 0.05, 0.03, 20.0, 1.0)
    more = magic_formula(read_tyre(folder(text)), *slip)
    plain = magic_formula(read_tyre(folder(SUV)), *slip)
    load, side = 7000.0 / 6000.0, plain[1] / 6000.0
    wave = np.sin(1.0 * 0.03 + 2.0 * np.arctan(1.5 * side))
    share = 0.05 * np.cos(0.4 * np.arctan((0.9 * load) ** 2)) * wave
    share += 0.3 * np.arctan(0.7 * load) * 0.03
    assert more[2] - plain[2] == pytest.approx(7000.0 * 0.369 * share, rel=1e-9)
    assert more[:2] == plain[:2]


def test_more_terms_of_the_rolling_resistance_are_used(folder):
    text = put("ROLLING_COEFFICIENTS", "QSY5 = 0.2", "QSY6 = 0.1", "QSY7 = -0.15", "QSY8 = -0.4")
    text = put("TIRE_CONDITIONS", "IP = 2e5", "IP_NOM = 2.5e5", text=text)
    tyre = read_tyre(folder(text))
    speed, load = 20.0 / 16.7, 8000.0 / 6000.0
    share = 0.010 + 0.0005 * speed + 0.0001 * speed**4 + (0.2 + 0.1 * load) * 0.1**2
    expected = -8000.0 * 0.369 * share * load**-0.15 * 0.8**-0.4
    out = magic_formula(tyre, 8000.0, 0.0, 0.0, 0.1, 20.0, 1.0)
    assert out[3] == pytest.approx(expected, rel=1e-9)


def test_camber_has_a_factor(folder):
    tyre = read_tyre(folder(put("SCALING_COEFFICIENTS", "LKYG = 0.5")))
    assert (tyre["phy3"], tyre["pvy3"], tyre["pvy4"]) == (0.015, -0.15, -0.05)


def test_uncombined_mode_has_the_forces_of_pure_slip(folder):
    tyre = read_tyre(folder(put("MODEL", "USE_MODE = 13")))
    plain = read_tyre(folder(SUV))
    both = magic_formula(tyre, 6000.0, 0.05, 0.04, 0.02, 20.0, 1.0)
    along = magic_formula(plain, 6000.0, 0.05, 0.0, 0.02, 20.0, 1.0)
    across = magic_formula(plain, 6000.0, 0.0, 0.04, 0.02, 20.0, 1.0)
    assert both[0] == pytest.approx(along[0], rel=1e-12)
    assert both[1] == pytest.approx(across[1], rel=1e-12)
    arm = across[1] / 6000.0 * 0.02 + 0.005  # of the shift of F_x at pure side slip
    assert both[4] == pytest.approx(across[4] - arm * 0.369 * across[0], rel=1e-9)


def test_steady_state_mode_has_no_relaxation_and_says_so(folder):
    with pytest.warns(TwinWarning, match="USE_MODE = 4 leaves out the relaxation"):
        tyre = read_tyre(folder(put("MODEL", "USE_MODE = 4")))
    assert relaxation_lengths(tyre, 6000.0, 0.0) == (0.02, 0.02)


@pytest.mark.parametrize("mode", ["14", "-14", "15", "124"])
def test_modes_of_the_whole_model_change_nothing(folder, mode):
    assert read_tyre(folder(put("MODEL", f"USE_MODE = {mode}"))) == read_tyre(folder(SUV))


@pytest.mark.parametrize("mode", ["0", "11", "2", "3.5"])
def test_mode_without_forces_is_refused(folder, mode):
    message = refusal(folder(put("MODEL", f"USE_MODE = {mode}")))
    assert f"USE_MODE = {mode}, allowed are those with longitudinal and lateral forces" in message


def test_missing_relaxation_lengths_have_defaults_that_are_named(folder):
    text = SUV
    for key in ("PTX1", "PTX2", "PTX3", "PTY1", "PTY2"):
        text = changed(key, None, text)
    with pytest.warns(TwinWarning, match="no relaxation lengths of its own: PTX1 = 0.55, PTX2"):
        tyre = read_tyre(folder(text))
    assert tyre == read_tyre(folder(SUV))


@pytest.mark.parametrize(("key", "value"), [("PDX3", None), ("WIDTH", None), ("WIDTH", "")])
def test_key_that_may_be_missing_has_a_default(folder, key, value):
    tyre = read_tyre(folder(changed(key, value)))
    assert tyre[key.lower()] == 0.0


def test_rolling_radius_may_grow_with_the_load(folder):
    assert read_tyre(folder(changed("FREFF", "-0.005")))["freff"] == -0.005


def test_load_range_below_the_nominal_load_is_a_range_like_any_other(folder):
    tyre = read_tyre(folder(changed("FZMAX", "3000")))
    assert (tyre["fzmin"], tyre["fzmax"]) == (120.0, 3000.0)
    at_end = magic_formula(tyre, 3000.0, 0.0, 0.05, 0.0, 20.0, 1.0)[1]
    beyond = magic_formula(tyre, 6000.0, 0.0, 0.05, 0.0, 20.0, 1.0)[1]
    assert beyond == pytest.approx(2.0 * at_end, rel=1e-12)


def test_everything_that_is_missing_is_named_at_once(folder):
    text = SUV.replace("[ROLLING_COEFFICIENTS]", "[NOTES]")
    for key in ("FNOMIN", "PKY1", "PKY2", "TIME"):
        text = changed(key, None, text)
    message = refusal(folder(text))
    assert "[UNITS] TIME; [VERTICAL] FNOMIN; " in message
    assert "[LATERAL_COEFFICIENTS] PKY1, PKY2; [ROLLING_COEFFICIENTS] are missing" in message


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


@pytest.mark.parametrize(
    "key", [key for keys in REQUIRED.values() for key in keys if key not in DEFAULTS]
)
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


def test_load_range_far_below_the_nominal_load_is_refused(folder):
    assert "FZMAX = 200, allowed is 5 % of FNOMIN" in refusal(folder(changed("FZMAX", "200")))


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
        warnings.simplefilter("ignore", TwinWarning)
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


def test_command_line_shows_what_is_not_used_as_one_line(tmp_path, capsys):
    (tmp_path / "own.tir").write_text(put("SCALING_COEFFICIENTS", "LMYU = 0.5"))
    (tmp_path / "car.toml").write_text('[tyre.rear]\nfile = "own.tir"\n')
    with warnings.catch_warnings():
        warnings.simplefilter("default")
        command = ["estimate", "none.csv", "--vehicle", str(tmp_path / "car.toml")]
        status = main([*command, "--out", str(tmp_path / "out")])
    lines = capsys.readouterr().err.splitlines()
    assert status == 2
    (note,) = [line for line in lines if line.startswith("til: note: ")]
    assert note.endswith("own.tir': not used: [SCALING_COEFFICIENTS] LMYU")
