"""MF 6.1 and 6.2 against the equations of the book, written out once more in plain NumPy."""

import re

import numpy as np
import pytest
from cars import inputs, run
from hypothesis import given, settings
from hypothesis import strategies as st

import models
from twin import Twin, TwinError, Vehicle
from twin.tyre.magic_formula import magic_formula, relaxation_lengths, slip_stiffnesses
from twin.tyre.radius import effective_radius
from twin.tyre.tir import read_tyre
from twin.tyre.tir_6 import EXTRA_SCALING, OPTIONAL, only_in_6, only_in_52

SUV = models.path("tyres/suv.tir").read_text()
# Chosen: a plausible tyre, every term of MF 6 awake
NEW = {
    "OPERATING_CONDITIONS": {"INFLPRES": 2.5e5, "NOMPRES": 2.2e5},
    "VERTICAL": {"Q_RE0": 0.998, "PFZ1": 0.7},
    "STRUCTURAL": {
        **{"LONGITUDINAL_STIFFNESS": 4.5e5, "LATERAL_STIFFNESS": 1.8e5},
        **{"PCFX1": 0.17, "PCFX2": -0.1, "PCFX3": 0.5, "PCFY1": 0.16, "PCFY2": -0.12, "PCFY3": 0.3},
    },
    "LONGITUDINAL_COEFFICIENTS": {
        **{"PPX1": -0.35, "PPX2": 0.3, "PPX3": -0.1, "PPX4": 0.2, "RBX3": 1.5},
    },
    "OVERTURNING_COEFFICIENTS": {
        **{"PPMX1": 0.4, "QSX4": 0.02, "QSX5": 1.2, "QSX6": 0.8, "QSX7": 1.1, "QSX8": 0.9},
        **{"QSX9": 1.3, "QSX10": 0.05, "QSX11": 1.4, "QSX12": 0.1, "QSX13": 0.01, "QSX14": 0.02},
    },
    "LATERAL_COEFFICIENTS": {
        **{"PEY5": 0.5, "PKY4": 1.9, "PKY5": 0.4, "PKY6": -0.9, "PKY7": -0.2, "RBY4": 2.0},
        **{"PPY1": -0.6, "PPY2": -0.06, "PPY3": -0.15, "PPY4": 0.1, "PPY5": -0.3},
    },
    "ROLLING_COEFFICIENTS": {"QSY5": 0.2, "QSY6": 0.1, "QSY7": 0.85, "QSY8": -0.4},
    "ALIGNING_COEFFICIENTS": {"PPZ1": -0.4, "PPZ2": 0.3, "QDZ10": 0.1, "QDZ11": 0.05},
}
SCALES = {"LKYC": 0.9, "LKZC": 1.2, "LMX": 1.1, "LVMX": 0.9, "LKY": 1.05, "LMUY": 0.97, "LMY": 1.3}


def text_of(new, scales=(), model="61"):
    """The SUV's file as one of MF 6, with these further coefficients."""
    text = re.sub(r"(?m)^FITTYP .*$", f"FITTYP = {model}", SUV)
    for key in only_in_52():
        text = re.sub(rf"(?m)^{key} .*\n", "", text)
    for key, value in dict(scales).items():
        text = re.sub(rf"(?m)^{key} .*\n", "", text)
        text = text.replace("[SCALING_COEFFICIENTS]", f"[SCALING_COEFFICIENTS]\n{key} = {value}")
    for section, values in new.items():
        lines = "".join(f"{key} = {value!r}\n" for key, value in values.items())
        if f"[{section}]" not in text:
            text += f"[{section}]\n"
        text = text.replace(f"[{section}]\n", f"[{section}]\n{lines}")
    return text


def raw(text):
    """The numbers of a file by key, in lower case; what is left out is 0."""
    found = re.findall(r"(?m)^(\w+)\s*=\s*([-+.\deE]+)\s*(?:\$.*)?$", text)
    return {key.lower(): float(value) for key, value in found}


@pytest.fixture
def tyre(tmp_path):
    """A function that reads a tyre from a text."""

    def read(text):
        path = tmp_path / "tyre.tir"
        path.write_text(text)
        return read_tyre(path)

    return read


def pressure(t):
    return (t["inflpres"] - t["nompres"]) / t["nompres"]


def stiffnesses(t, fz, gamma):
    """K_xkappa and K_yalpha, (4.E15) and (4.E25)."""
    fz0, p = t["fnomin"] * t["lfzo"], pressure(t)
    d = (fz - fz0) / fz0
    kx = fz * (t["pkx1"] + t["pkx2"] * d) * np.exp(t["pkx3"] * d) * t["lkx"]
    kx *= 1 + t["ppx1"] * p + t["ppx2"] * p**2
    at = (t["pky2"] + t["pky5"] * gamma**2) * (1 + t["ppy2"] * p)
    ky = t["pky1"] * fz0 * (1 + t["ppy1"] * p) * np.sin(t["pky4"] * np.arctan(fz / fz0 / at))
    return kx, ky * (1 - t["pky3"] * abs(gamma)) * t["lky"]


def inner(b, c, e, x):
    return c * np.arctan(b * x - e * (b * x - np.arctan(b * x)))


def pure_lateral(t, fz, alpha, gamma):
    """F_y0 and what else of it the moments need, (4.E19)-(4.E30)."""
    fz0, p = t["fnomin"] * t["lfzo"], pressure(t)
    d = (fz - fz0) / fz0
    _, ky = stiffnesses(t, fz, gamma)
    svy_gamma = fz * (t["pvy3"] + t["pvy4"] * d) * gamma * t["lkyc"] * t["lmuy"]
    ky_gamma = fz * (t["pky6"] + t["pky7"] * d) * (1 + t["ppy5"] * p) * t["lkyc"]
    shy = (t["phy1"] + t["phy2"] * d) * t["lhy"] + (ky_gamma * gamma - svy_gamma) / ky
    svy = fz * (t["pvy1"] + t["pvy2"] * d) * t["lvy"] * t["lmuy"] + svy_gamma
    mu = (t["pdy1"] + t["pdy2"] * d) * (1 + t["ppy3"] * p + t["ppy4"] * p**2)
    mu *= (1 - t["pdy3"] * gamma**2) * t["lmuy"]
    cy = t["pcy1"] * t["lcy"]
    ey = (t["pey1"] + t["pey2"] * d) * t["ley"]
    ey *= 1 + t["pey5"] * gamma**2 - (t["pey3"] + t["pey4"] * gamma) * np.sign(alpha + shy)
    fy0 = mu * fz * np.sin(inner(ky / (cy * mu * fz), cy, ey, alpha + shy)) + svy
    return fy0, mu, shy, svy, ky / (mu * fz)


def by_the_book(t, fz, kappa, alpha, gamma, vx):
    """Forces and moments of MF 6.1 without any limit."""
    fz0, p, r0 = t["fnomin"] * t["lfzo"], pressure(t), t["unloaded_radius"]
    d = (fz - fz0) / fz0
    cos, sin, arctan = np.cos, np.sin, np.arctan
    kx, ky = stiffnesses(t, fz, gamma)
    fy0, mu_y, shy, svy, by_cy = pure_lateral(t, fz, alpha, gamma)

    kappa_x = kappa + (t["phx1"] + t["phx2"] * d) * t["lhx"]
    mu_x = (t["pdx1"] + t["pdx2"] * d) * (1 + t["ppx3"] * p + t["ppx4"] * p**2)
    mu_x *= (1 - t["pdx3"] * gamma**2) * t["lmux"]
    cx = t["pcx1"] * t["lcx"]
    ex = (t["pex1"] + t["pex2"] * d + t["pex3"] * d**2) * (1 - t["pex4"] * np.sign(kappa_x))
    fx0 = mu_x * fz * sin(inner(kx / (cx * mu_x * fz), cx, ex * t["lex"], kappa_x))
    fx0 += fz * (t["pvx1"] + t["pvx2"] * d) * t["lvx"] * t["lmux"]

    b = (t["rbx1"] + t["rbx3"] * gamma**2) * cos(arctan(t["rbx2"] * kappa)) * t["lxal"]
    c, e, shift = t["rcx1"], t["rex1"] + t["rex2"] * d, t["rhx1"]
    fx = fx0 * cos(inner(b, c, e, alpha + shift)) / cos(inner(b, c, e, shift))
    b = (t["rby1"] + t["rby4"] * gamma**2) * t["lyka"]
    b *= cos(arctan(t["rby2"] * (alpha - t["rby3"])))
    c, e, shift = t["rcy1"], t["rey1"] + t["rey2"] * d, t["rhy1"] + t["rhy2"] * d
    weight = cos(inner(b, c, e, kappa + shift)) / cos(inner(b, c, e, shift))
    svyk = mu_y * fz * (t["rvy1"] + t["rvy2"] * d + t["rvy3"] * gamma)
    svyk *= cos(arctan(t["rvy4"] * alpha)) * sin(t["rvy5"] * arctan(t["rvy6"] * kappa))
    fy = weight * fy0 + svyk * t["lvyka"]

    alpha_t = alpha + t["qhz1"] + t["qhz2"] * d + (t["qhz3"] + t["qhz4"] * d) * gamma
    alpha_r = alpha + shy + svy / ky
    t_eq = arctan(np.hypot(np.tan(alpha_t), kx / ky * kappa)) * np.sign(alpha_t)
    r_eq = arctan(np.hypot(np.tan(alpha_r), kx / ky * kappa)) * np.sign(alpha_r)
    bt = (t["qbz1"] + t["qbz2"] * d + t["qbz3"] * d**2) * t["lky"] / t["lmuy"]
    bt *= 1 + t["qbz4"] * gamma + t["qbz5"] * abs(gamma)
    dt = (t["qdz1"] + t["qdz2"] * d) * (1 - t["ppz1"] * p) * fz * r0 / fz0 * t["ltr"]
    dt *= 1 + t["qdz3"] * gamma + t["qdz4"] * gamma**2
    et = t["qez1"] + t["qez2"] * d + t["qez3"] * d**2
    et *= 1 + (t["qez4"] + t["qez5"] * gamma) * 2 / np.pi * arctan(bt * t["qcz1"] * alpha_t)
    trail = dt * cos(inner(bt, t["qcz1"], et, t_eq)) * cos(alpha)
    br = t["qbz9"] * t["lky"] / t["lmuy"] + t["qbz10"] * by_cy
    dr = (t["qdz8"] + t["qdz9"] * d) * (1 + t["ppz2"] * p)
    dr = (dr + (t["qdz10"] + t["qdz11"] * d) * abs(gamma)) * gamma * t["lkzc"]
    dr = fz * r0 * (dr + (t["qdz6"] + t["qdz7"] * d) * t["lres"]) * t["lmuy"]
    s = r0 * (t["ssz1"] + t["ssz2"] * fy / fz0 + (t["ssz3"] + t["ssz4"] * d) * gamma) * t["ls"]
    upright = weight * pure_lateral(t, fz, alpha, 0.0)[0]
    mz = -trail * upright + dr * cos(arctan(br * r_eq)) * cos(alpha) + s * fx

    mx = t["qsx1"] * t["lvmx"] - t["qsx2"] * gamma * (1 + t["ppmx1"] * p) + t["qsx3"] * fy / fz0
    wave = sin(t["qsx7"] * gamma + t["qsx8"] * arctan(t["qsx9"] * fy / fz0))
    mx += t["qsx4"] * cos(t["qsx5"] * arctan((t["qsx6"] * fz / fz0) ** 2)) * wave
    mx += t["qsx10"] * arctan(t["qsx11"] * fz / fz0) * gamma - t["qsx12"] * gamma * abs(gamma)
    mx = r0 * t["lmx"] * (fz * mx + fy * (t["qsx13"] + t["qsx14"] * abs(gamma)))
    v = vx / t["longvl"]
    my = t["qsy1"] + t["qsy2"] * fx / fz0 + t["qsy3"] * abs(v) + t["qsy4"] * v**4
    my += (t["qsy5"] + t["qsy6"] * fz / fz0) * gamma**2
    my *= (fz / fz0) ** t["qsy7"] * (t["inflpres"] / t["nompres"]) ** t["qsy8"]
    return fx, fy, mx, -r0 * fz0 * t["lmy"] * my, mz


CASES = np.random.default_rng(2).uniform(
    (500.0, -0.15, -0.2, -0.2, 10.0), (12000.0, 0.15, 0.2, 0.2, 40.0), (300, 5)
)


def test_forces_and_moments_are_those_of_the_book(tyre):
    text = text_of(NEW, SCALES)
    record, t = tyre(text), raw(text)
    for case in CASES:
        ours = magic_formula(record, *case, 1.0)
        np.testing.assert_allclose(ours, by_the_book(t, *case), rtol=1e-9, atol=1e-9)


def test_stiffnesses_relaxation_and_rolling_radius_are_those_of_the_paper(tyre):
    text = text_of(NEW, SCALES)
    record, t = tyre(text), raw(text)
    p = pressure(t)
    for fz, _, _, gamma, _ in CASES[:50]:
        d = fz / 6000.0 - 1.0
        kx, ky = stiffnesses(t, fz, gamma)
        assert slip_stiffnesses(record, fz, gamma) == pytest.approx((kx, -ky), rel=1e-12)
        cx = 4.5e5 * (1 + 0.17 * d - 0.1 * d**2 + 0.5 * p)
        cy = 1.8e5 * (1 + 0.16 * d - 0.12 * d**2 + 0.3 * p)
        assert relaxation_lengths(record, fz, gamma) == pytest.approx((kx / cx, -ky / cy))
        loss = 0.24 * np.arctan(4.0 * fz / 6000.0) + 0.04 * fz / 6000.0
        radius = 0.998 * 0.369 - 6000.0 / (260000 * (1 + 0.7 * p)) * loss
        assert effective_radius(record, fz) == pytest.approx(radius, rel=1e-12)


def test_forces_of_an_upright_neutral_tyre_are_those_of_mf_52(tyre):
    neutral = {
        "STRUCTURAL": {"LONGITUDINAL_STIFFNESS": 4e5, "LATERAL_STIFFNESS": 2e5},
        "LATERAL_COEFFICIENTS": {"PKY4": 2.0, "PKY6": -0.9},
    }
    six, five = tyre(text_of(neutral, model="62")), tyre(SUV)
    for fz, kappa, alpha, _, vx in CASES[:50]:
        ours, theirs = (magic_formula(t, fz, kappa, alpha, 0.0, vx, 1.0) for t in (six, five))
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-9)


def test_camber_stiffness_is_pky6_at_the_nominal_load(tyre):
    new = {**NEW, "OPERATING_CONDITIONS": {}}
    record = tyre(text_of(new))
    ahead, behind = (
        magic_formula(record, 6000.0, 0.0, 0.0, g, 20.0, 1.0)[1] for g in (1e-5, -1e-5)
    )
    # over alpha the slope is K_y cos of where the shifts put it: near one, not quite
    assert (ahead - behind) / 2e-5 == pytest.approx(-0.9 * 6000.0, rel=0.02)


def test_car_may_have_a_tyre_of_each_kind(tmp_path, tyre):
    (tmp_path / "six.tir").write_text(text_of(NEW, SCALES))
    (tmp_path / "car.toml").write_text('[tyre.rear]\nfile = "six.tir"\n')
    vehicle = Vehicle.load(tmp_path / "car.toml")
    twin = Twin(vehicle)
    twin.reset(20.0)
    made = run(twin, inputs(1.0, steering=0.5))
    speed = made.states[-1, 14]
    for wheel, (record, side) in enumerate(
        zip(vehicle.tyres(), (1.0, -1.0, 1.0, -1.0), strict=True)
    ):
        fx, fy, fz, *_, kappa, alpha, camber = made.tyres[-1, wheel]
        alone = magic_formula(record, fz, kappa, alpha, camber, speed, side)
        np.testing.assert_allclose((fx, fy), alone[:2], rtol=1e-9, atol=1e-6)


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("PKY4", None, "[LATERAL_COEFFICIENTS] PKY4 is missing"),
        ("LATERAL_STIFFNESS", None, "[STRUCTURAL] LATERAL_STIFFNESS is missing"),
        ("LATERAL_STIFFNESS", "0", "LATERAL_STIFFNESS = '0', allowed is a number from 1000"),
        ("INFLPRES", "2.5", "INFLPRES = '2.5', allowed is a number from 1000"),
        ("PPX3", "-100", "PDX1 at INFLPRES is"),
        ("LMUV", "0.1", "LMUV = 0.1, only 0 is allowed"),
    ],
)
def test_fault_is_one_line_that_names_it(tyre, key, value, message):
    text = re.sub(rf"(?m)^{key} .*\n", "", text_of(NEW, {"LMUV": 0.0}))
    if value is not None:
        section = next((s for s, keys in NEW.items() if key in keys), "SCALING_COEFFICIENTS")
        text = text.replace(f"[{section}]\n", f"[{section}]\n{key} = {value}\n")
    with pytest.raises(TwinError) as caught:
        tyre(text)
    assert message in str(caught.value)
    assert "\n" not in str(caught.value)


def test_every_further_coefficient_of_the_reader_is_awake_in_these_tests():
    known = {key for keys in (*OPTIONAL.values(), *only_in_6().values()) for key in keys}
    assert known == {key for keys in NEW.values() for key in keys}
    assert set(EXTRA_SCALING) == {"LKYC", "LKZC", "LMUV"}


@settings(deadline=None, max_examples=100)
@given(seed=st.integers(0, 10**6), fz=st.floats(-1e3, 1e5), kappa=st.floats(-1e9, 1e9))
def test_any_coefficients_give_finite_forces(tmp_path_factory, seed, fz, kappa):
    rng = np.random.default_rng(seed)
    wild = {s: {k: float(rng.uniform(-20, 20)) for k in keys} for s, keys in NEW.items()}
    wild["STRUCTURAL"] |= {"LONGITUDINAL_STIFFNESS": 1e5, "LATERAL_STIFFNESS": 1e5}
    wild["LATERAL_COEFFICIENTS"]["PKY4"] = float(rng.uniform(0.1, 5.0))
    wild["ROLLING_COEFFICIENTS"] |= {"QSY7": 2.0, "QSY8": -2.0}
    wild["VERTICAL"]["Q_RE0"] = 1.1
    wild.pop("OPERATING_CONDITIONS")
    path = tmp_path_factory.getbasetemp() / "wild.tir"
    path.write_text(text_of(wild))
    tyre = read_tyre(path)
    alpha, gamma = rng.uniform(-2.0, 2.0, 2)
    assert np.isfinite(magic_formula(tyre, fz, kappa, alpha, gamma, 30.0, 1.0)).all()
    assert np.isfinite(relaxation_lengths(tyre, fz, gamma)).all()
    assert effective_radius(tyre, fz) > 0.0
