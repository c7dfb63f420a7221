"""The real vehicles: what the twin does not know of."""

import numpy as np

import models
from twin import PointMass

# TiL Table 2 gives the masses, not where they are; and no set of point masses of that table gives
# Table 3 (its inertias would need a negative sum of m r^2). Chosen: seats and boot of an SUV this
# size, from the chassis frame, 1.25 m behind the front axle and 0.644 m above the road.
SUV_LOADS = tuple(
    PointMass(name=name, mass=mass, position=np.array(position))
    for name, mass, position in (
        ("front_passenger", 75.0, (0.10, -0.42, 0.26)),
        ("rear_left_passenger", 80.0, (-0.75, 0.42, 0.26)),
        ("rear_right_passenger", 65.0, (-0.75, -0.42, 0.26)),
        ("rear_middle_passenger", 75.0, (-0.75, 0.0, 0.26)),
        ("luggage_left", 30.0, (-1.65, 0.45, 0.20)),
        ("luggage_right", 30.0, (-1.65, -0.45, 0.20)),
    )
)


def suv_loaded_mjcf() -> str:
    """The text of models/suv_loaded.xml: suv.xml with the loads as bodies fixed to its chassis.

    After a change of either: `python -m scenarios.plants.vehicles > models/suv_loaded.xml`.
    """
    text = models.path("suv").read_text()
    bodies = "".join(
        f'      <body name="{load.name}" pos="{" ".join(map(str, load.position))}">\n'
        f'        <inertial pos="0 0 0" mass="{load.mass}" diaginertia="1e-9 1e-9 1e-9"/>\n'
        f'        <geom type="sphere" size="0.2" rgba="0.85 0.45 0.1 1"/>\n'
        f"      </body>\n"
        for load in SUV_LOADS
    )
    end = "    </body>\n  </worldbody>"
    return (
        text.replace('<mujoco model="suv">', '<mujoco model="suv_loaded">')
        .replace(
            "<!-- A large",
            "<!-- Made from suv.xml by scenarios/plants/vehicles.py: TiL Table 2's loads.\n\n"
            "  A large",
        )
        .replace(
            end,
            f"\n      <!-- TiL Table 2, point masses; their places are chosen. -->\n{bodies}{end}",
        )
    )


if __name__ == "__main__":
    print(suv_loaded_mjcf(), end="")
