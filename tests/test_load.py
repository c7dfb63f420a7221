import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as npst

from twin import PARAMETERS
from twin.car.load import PointMass, RigidBody, loaded, parameter_deltas, steiner
from twin.errors import TwinError

# TiL Table 1
SUV = RigidBody(
    mass=2125.8,
    cm=np.array([-1.25, -0.00003, 0.644]),
    inertia=np.array([[834.23, 0.14, 0.097], [0.14, 3640.182, 3.86], [0.097, 3.86, 3932.77]]),
)
# Plausible places; the masses add up to some of TiL Table 2
LOADS = (
    PointMass(name="passenger", mass=75.0, position=np.array([-1.3, -0.4, 0.7])),
    PointMass(name="rear left", mass=60.0, position=np.array([-2.2, 0.4, 0.72])),
    PointMass(name="boot", mass=220.0, position=np.array([-3.1, 0.1, 0.8])),
)
BODIES = st.builds(
    lambda mass, cm, spread: RigidBody(mass=mass, cm=cm, inertia=_box_inertia(mass, spread)),
    st.floats(100.0, 3000.0),
    npst.arrays(float, 3, elements=st.floats(-3.0, 3.0)),
    npst.arrays(float, 3, elements=st.floats(0.3, 3.0)),
)
POINTS = st.lists(
    st.builds(
        PointMass,
        name=st.just("load"),
        mass=st.floats(0.0, 500.0),
        position=npst.arrays(float, 3, elements=st.floats(-3.0, 3.0)),
    ),
    max_size=5,
)


def _box_inertia(mass, sides):
    return np.diag(mass / 12.0 * (sides @ sides - sides**2))


def mujoco_composite(body, masses):
    """Mass, CM and inertia that MuJoCo gives a chassis with loads welded on as child bodies."""
    spec = mujoco.MjSpec()
    spec.option.gravity = [0.0, 0.0, 0.0]
    chassis = spec.worldbody.add_body(
        name="chassis", mass=body.mass, ipos=body.cm, explicitinertial=True
    )
    inertia = body.inertia
    chassis.fullinertia = [*np.diag(inertia), inertia[0, 1], inertia[0, 2], inertia[1, 2]]
    chassis.add_freejoint()
    for load in masses:
        # MuJoCo wants some inertia of every body: 1e-11 of the chassis' own.
        chassis.add_body(
            pos=load.position,
            mass=load.mass,
            ipos=[0.0] * 3,
            inertia=[1e-8] * 3,
            explicitinertial=True,
        )
    model = spec.compile()
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    matrix = np.zeros((model.nv, model.nv))
    mujoco.mj_fullM(model, data, matrix)
    mass = matrix[0, 0]
    cm = data.subtree_com[1].copy()
    about_origin = matrix[3:, 3:]
    return mass, cm, about_origin - steiner(mass, cm)


@pytest.mark.parametrize("count", [1, 2, 3])
def test_loaded_body_is_the_composite_of_mujoco(count):
    body = loaded(SUV, LOADS[:count])
    mass, cm, inertia = mujoco_composite(SUV, LOADS[:count])
    assert body.mass == pytest.approx(mass, rel=1e-12)
    np.testing.assert_allclose(body.cm, cm, rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(body.inertia, inertia, rtol=1e-9, atol=1e-9 * 4000.0)


def test_dumbbell_by_hand():
    # Two equal points at y = 0 and y = 2 m: CM halfway, each 1 m away.
    body = loaded(_near_point(10.0), [PointMass(name="b", mass=10.0, position=np.array([0, 2, 0]))])
    assert body.mass == 20.0
    np.testing.assert_allclose(body.cm, [0.0, 1.0, 0.0])
    np.testing.assert_allclose(body.inertia, np.diag([20.0, 0.0, 20.0]), atol=1e-8)


def test_product_of_inertia_by_hand():
    # Points at the origin and at (2, 2, 0): each (1, 1, 0) from the CM, Jxy = -2 m x y.
    body = loaded(_near_point(10.0), [PointMass(name="b", mass=10.0, position=np.array([2, 2, 0]))])
    assert body.inertia[0, 1] == pytest.approx(-20.0)


@pytest.mark.parametrize(("sign", "inertia"), [(-1.0, 10.0), (+1.0, 30.0)])
def test_til_equation_8_needs_a_plus_where_it_prints_a_minus(sign, inertia):
    # 10 kg at y = 0 and 5 kg at y = 3 m, CM at y = 1 m: 10 x 1 + 5 x 4 = 30 kg m2 by definition.
    body = loaded(_near_point(10.0), [PointMass(name="b", mass=5.0, position=np.array([0, 3, 0]))])
    d_y, d_z = body.cm[1:]
    equation_8 = sign * 10.0 * (d_y**2 + d_z**2) + 5.0 * ((3.0 - d_y) ** 2 + d_z**2)
    assert equation_8 == pytest.approx(inertia)
    assert (equation_8 == pytest.approx(body.inertia[0, 0])) == (sign > 0.0)


def test_load_at_the_cm_changes_the_mass_alone():
    deltas = parameter_deltas(SUV, loaded(SUV, [PointMass(name="b", mass=50.0, position=SUV.cm)]))
    np.testing.assert_allclose(deltas, [50.0] + [0.0] * (len(PARAMETERS) - 1), atol=1e-9)


def test_no_load_changes_nothing():
    np.testing.assert_allclose(parameter_deltas(SUV, loaded(SUV, [])), 0.0, atol=1e-12)


def test_deltas_stand_in_the_order_of_their_names():
    body = loaded(SUV, LOADS)
    deltas = dict(zip(PARAMETERS, parameter_deltas(SUV, body), strict=True))
    assert deltas["mass"] == pytest.approx(355.0)
    for axis, name in enumerate(("cm_x", "cm_y", "cm_z")):
        assert deltas[name] == body.cm[axis] - SUV.cm[axis]
    change = body.inertia - SUV.inertia
    for name, row, column in (
        ("Jxx", 0, 0), ("Jyy", 1, 1), ("Jzz", 2, 2), ("Jxy", 0, 1), ("Jxz", 0, 2), ("Jyz", 1, 2)
    ):  # fmt: skip
        assert deltas[name] == pytest.approx(change[row, column], abs=1e-9)


@settings(deadline=None)
@given(body=BODIES, masses=POINTS)
def test_loads_may_be_fixed_in_any_order_or_one_by_one(body, masses):
    at_once = loaded(body, masses)
    one_by_one = body
    for load in reversed(masses):
        one_by_one = loaded(one_by_one, [load])
    assert one_by_one.mass == pytest.approx(at_once.mass)
    np.testing.assert_allclose(one_by_one.cm, at_once.cm, atol=1e-9)
    np.testing.assert_allclose(one_by_one.inertia, at_once.inertia, atol=1e-7)


@settings(deadline=None)
@given(body=BODIES, masses=POINTS)
def test_load_never_takes_inertia_away(body, masses):
    change = loaded(body, masses).inertia - body.inertia
    assert np.linalg.eigvalsh(change)[0] > -1e-7


def test_arrays_of_a_body_are_copied_and_read_only():
    cm = np.zeros(3)
    body = RigidBody(mass=1.0, cm=cm, inertia=np.eye(3))
    cm[:] = 1.0
    assert not body.cm.any()
    for array in (body.cm, body.inertia, LOADS[0].position):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 1.0


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"mass": 0.0}, "mass is 0 kg, must be positive"),
        ({"mass": np.nan}, "mass is nan kg, must be positive"),
        ({"mass": np.inf}, "mass is inf kg, must be positive"),
        ({"cm": np.zeros(2)}, r"cm is \[0.0, 0.0\], must be finite numbers of shape \(3,\)"),
        ({"cm": np.array([0.0, np.nan, 0.0])}, "cm is .*nan"),
        ({"inertia": np.eye(2)}, r"inertia is .* must be finite numbers of shape \(3, 3\)"),
        ({"inertia": np.eye(3) + np.eye(3, k=1)}, "must be symmetric"),
        ({"inertia": np.diag([1.0, 1.0, 0.0])}, "principal inertias are 0, 1, 1 kg m2, must be"),
        ({"inertia": np.diag([1.0, 1.0, -1.0])}, "must be positive"),
        ({"inertia": np.diag([1.0, 1.0, 2.1])}, "none may exceed the sum of the others"),
    ],
)
def test_impossible_body_is_refused(changes, message):
    with pytest.raises(TwinError, match=message):
        RigidBody(**({"mass": 1.0, "cm": np.zeros(3), "inertia": np.eye(3)} | changes))


@pytest.mark.parametrize("mass", [-1.0, np.nan])
def test_negative_load_is_refused_by_name(mass):
    with pytest.raises(TwinError, match=r"load boot: mass is .* kg, must not be negative"):
        PointMass(name="boot", mass=mass, position=np.zeros(3))


def test_flat_plate_is_a_body():
    # Jzz = Jxx + Jyy exactly: the triangle inequality holds as an equation.
    assert RigidBody(mass=1.0, cm=np.zeros(3), inertia=np.diag([0.1, 0.2, 0.1 + 0.2])).mass == 1.0


def _near_point(mass):
    return RigidBody(mass=mass, cm=np.zeros(3), inertia=1e-10 * np.eye(3))
