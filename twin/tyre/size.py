"""A plausible tyre from its size and load index, by rules that name their sources."""

import math
import re
from typing import NamedTuple

import models
from twin.errors import TwinError

INCH = 0.0254  # [m]
GRAVITY = 9.81  # [m/s2]
NOMINAL_SHARE = 2.0 / 3.0  # nominal load over capacity; chosen: 4 kN for a 205/55 R16 91
PRESSURE = 230_000.0  # [Pa], chosen: usual in passenger cars
LOAD_INDICES = (50, 130)
_SIZE = re.compile(r"(?:P|LT)?\s*(\d{3})\s*/\s*(\d{2})\s*Z?RF?\s*(\d{2})(?:\s+(\d{2,3})[A-Z()]*)?")
NO_MEASUREMENT = "No measurement:"  # in the head of a tyre's file that was made from its size


class TyreSize(NamedTuple):
    """What stands on a tyre's side.

    Attributes:
        width: of the section [m].
        aspect: height of the side over the width.
        rim: diameter [m].
        load_index: after ISO 4000-1.
    """

    width: float
    aspect: float
    rim: float
    load_index: int

    @property
    def radius(self) -> float:
        """Without load [m]: half the rim and one side (ETRTO: outer diameter = d + 2 H)."""
        return 0.5 * self.rim + self.aspect * self.width

    @property
    def capacity(self) -> float:
        """Largest load [N]: 45 kg at index 0, tenfold every 80 (ISO 4000-1, to 1.5 %)."""
        return 45.0 * 10.0 ** (self.load_index / 80.0) * GRAVITY

    @property
    def vertical_stiffness(self) -> float:
        """[N/m] at 2.3 bar: Rhyne, Tire Science and Technology 33 (3), 2005.

        K = 0.00028 P sqrt((1.03 - 0.4 aspect) width diameter) + 3.45, in kg/mm, kPa and mm.
        """
        area = (1.03 - 0.4 * self.aspect) * self.width * 2.0 * self.radius * 1e6
        return (0.00028 * PRESSURE * 1e-3 * math.sqrt(area) + 3.45) * GRAVITY * 1e3

    @property
    def cornering_coefficient(self) -> float:
        """Cornering stiffness over load at the nominal load [1/rad].

        Chosen: 15.2 at an aspect of 0.55, as tyres/suv.tir, and more for lower sides.
        """
        return min(max(15.2 * math.sqrt(0.55 / self.aspect), 11.0), 22.0)


def parse_size(text: str, load_index: int | None = None) -> TyreSize:
    """The size that a text names, as 205/55R16 or 205/55 R16 91V.

    Args:
        text: the size, with a load index or without.
        load_index: counts before that of the text.

    Raises:
        TwinError: it is no size of a radial tyre, or there is no load index.
    """
    match = _SIZE.fullmatch(text.strip().upper())
    if not match:
        raise TwinError(f"tyre size is {text[:40]!r}; allowed: as 205/55R16 or '205/55 R16 91V'")
    index = load_index if load_index is not None else int(match[4] or 0)
    if not LOAD_INDICES[0] <= index <= LOAD_INDICES[1]:
        raise TwinError(
            f"load index of {text[:40]!r} is {index or 'missing'}; allowed: {LOAD_INDICES[0]} to "
            f"{LOAD_INDICES[1]}, the number behind the size on the tyre's side"
        )
    size = TyreSize(float(match[1]) * 1e-3, float(match[2]) * 1e-2, float(match[3]) * INCH, index)
    if not (0.1 <= size.width <= 0.45 and 0.2 <= size.aspect <= 0.95 and 0.2 < size.rim < 0.7):
        raise TwinError(
            f"tyre size is {text[:40]!r}; allowed: width 100 to 450 mm, aspect 20 to 95 %, rim 8 "
            "to 27 inch"
        )
    return size


def tyre_text(size: TyreSize, name: str) -> str:
    """The text of a .tir file: what tyres/suv.tir has, brought to this size.

    Args:
        size: of the tyre.
        name: of the tyre, for its head.
    """
    nominal = NOMINAL_SHARE * size.capacity
    rise = math.sin(2.0 * math.atan(1.0 / 1.9))  # of tyres/suv.tir at its nominal load
    values = {
        "UNLOADED_RADIUS": (size.radius, "half the rim and one side"),
        "WIDTH": (size.width, "of the section"),
        "VERTICAL_STIFFNESS": (size.vertical_stiffness, "Rhyne 2005, at 2.3 bar"),
        "FNOMIN": (nominal, "two thirds of the capacity of the load index; chosen"),
        "FZMIN": (0.02 * nominal, ""),
        "FZMAX": (1.5 * size.capacity, ""),
        "PKY1": (-size.cornering_coefficient / rise, "largest cornering stiffness; chosen"),
    }
    head = [
        f"$ {name}: load index {size.load_index}. {NO_MEASUREMENT} radius, loads and vertical",
        "$ stiffness follow from the size (see twin/tyre/size.py for the rules and their sources),",
        "$ all other coefficients are those of the project's tyres/suv.tir, which were chosen.",
        "$ Cornering stiffness is uncertain by some 25 %, friction by 15 %.",
    ]
    body = models.path("tyres/suv.tir").read_text()
    for key, (value, remark) in values.items():
        line = f"{key:19} = {value:.6g}" + (f"     $ {remark}" if remark else "")
        body, found = re.subn(rf"(?m)^{key} .*$", line, body)
        if found != 1:
            raise TwinError(f"tyres/suv.tir: has {key} {found} times, must have it once")
    return "\n".join(head) + "\n" + body[body.index("[MDI_HEADER]") :]
