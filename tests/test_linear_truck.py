import numpy as np
import pytest
from linear_truck import simulate, state_space
from scipy.integrate import solve_ivp

from twin.truck.parameters import SprungMass, TruckParameters


def equations_of_motion(x, road, truck=None):
    """KBF Eqs. (1)-(2) line by line, as the paper writes them."""
    p = truck or TruckParameters()
    z, roll, pitch, z_uf, z_ur, roll_uf, roll_ur = x[:7]
    dz, droll, dpitch, dz_uf, dz_ur, droll_uf, droll_ur = x[7:]
    (lf, lr), (tf, tr) = p.axle_distance, p.half_track
    (cf, cr), (kf, kr), (uf, ur) = p.spring_stiffness, p.damping, p.tyre_stiffness
    body = [
        z + tf * roll - lf * pitch,
        z - tf * roll - lf * pitch,
        z + tr * roll + lr * pitch,
        z - tr * roll + lr * pitch,
    ]
    rate = [
        dz + tf * droll - lf * dpitch,
        dz - tf * droll - lf * dpitch,
        dz + tr * droll + lr * dpitch,
        dz - tr * droll + lr * dpitch,
    ]
    axle = [z_uf + tf * roll_uf, z_uf - tf * roll_uf, z_ur + tr * roll_ur, z_ur - tr * roll_ur]
    axle_rate = [
        dz_uf + tf * droll_uf,
        dz_uf - tf * droll_uf,
        dz_ur + tr * droll_ur,
        dz_ur - tr * droll_ur,
    ]
    c, k, u = (cf, cf, cr, cr), (kf, kf, kr, kr), (uf, uf, ur, ur)
    s1, s2, s3, s4 = (
        k[i] * (rate[i] - axle_rate[i]) + c[i] * (body[i] - axle[i]) for i in range(4)
    )
    t1, t2, t3, t4 = (u[i] * (axle[i] - road[i]) for i in range(4))
    n = p.nominal
    return np.concatenate(
        [
            x[7:],
            [
                -(s1 + s2 + s3 + s4) / n.mass,
                -(tf * s1 - tf * s2 + tr * s3 - tr * s4) / n.roll_inertia,
                -(-lf * s1 - lf * s2 + lr * s3 + lr * s4) / n.pitch_inertia,
                ((s1 + s2) - (t1 + t2)) / p.axle_mass[0],
                ((s3 + s4) - (t3 + t4)) / p.axle_mass[1],
                ((s1 - s2) * tf - (t1 - t2) * tf) / p.axle_roll_inertia[0],
                ((s3 - s4) * tr - (t3 - t4) * tr) / p.axle_roll_inertia[1],
            ],
        ]
    )


def test_matrices_are_the_equations_of_motion():
    rng = np.random.default_rng(1)
    system = state_space(TruckParameters())
    for _ in range(5):
        x, road = rng.normal(size=14), rng.normal(size=4)
        expected = equations_of_motion(x, road)
        np.testing.assert_allclose(system.a @ x + system.b @ road, expected, rtol=1e-11, atol=1e-9)


def test_raising_the_whole_road_raises_everything_as_much():
    system = state_space(TruckParameters())
    rest = np.linalg.solve(system.a, -system.b @ np.full(4, 0.1))
    np.testing.assert_allclose(rest, [0.1, 0, 0, 0.1, 0.1, 0, 0, *np.zeros(7)], atol=1e-12)
    np.testing.assert_allclose(system.c @ rest, 0, atol=1e-12)


def test_the_truck_is_stable_and_heavier_ones_are_slower():
    nominal = np.linalg.eigvals(state_space(TruckParameters()).a)
    heavy = state_space(TruckParameters(), SprungMass().scaled(1.5)).a
    assert nominal.real.max() < 0
    assert np.abs(np.linalg.eigvals(heavy)).min() < np.abs(nominal).min()


def test_simulation_agrees_with_an_ode_solver():
    truck = TruckParameters()
    heights = np.tile([0.01, 0.02, -0.01, 0.0], (401, 1))
    states = simulate(state_space(truck), heights, 1e-3)
    solution = solve_ivp(
        lambda t, x: equations_of_motion(x, heights[0], truck),
        (0, 0.4),
        np.zeros(14),
        rtol=1e-9,
        atol=1e-12,
    )
    np.testing.assert_allclose(states[-1], solution.y[:, -1], rtol=1e-5, atol=1e-9)


def test_each_spring_carries_its_share_of_the_weight():
    truck = TruckParameters()
    loads = truck.static_spring_loads(9.81)
    assert loads.sum() == pytest.approx(5394 * 9.81)
    assert truck.body_geometry().T @ loads == pytest.approx([5394 * 9.81, 0, 0], abs=1e-9)
