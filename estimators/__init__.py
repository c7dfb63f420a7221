"""Observers that correct a black-box twin, and what tunes and scores them.

What needs compiled code is imported when it is first asked for.

>>> from estimators import til_observer
>>> til_observer("suv").guarded
True
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from estimators.base import Estimate, Estimator, OnlineEstimator
    from estimators.black_box import BlackBox
    from estimators.entry import Entry, Given
    from estimators.joint.default_observer import joint_observer
    from estimators.joint.observer import JointEstimate, JointObserver, JointSettings
    from estimators.registry import ESTIMATORS, make, register, usable
    from estimators.til.default_observer import til_observer
    from estimators.til.law import ParameterLaw
    from estimators.til.observer import Observer

_PLACES = {
    "BlackBox": "estimators.black_box",
    "ESTIMATORS": "estimators.registry",
    "Entry": "estimators.entry",
    "Estimate": "estimators.base",
    "Estimator": "estimators.base",
    "Given": "estimators.entry",
    "JointEstimate": "estimators.joint.observer",
    "JointObserver": "estimators.joint.observer",
    "JointSettings": "estimators.joint.observer",
    "Observer": "estimators.til.observer",
    "OnlineEstimator": "estimators.base",
    "ParameterLaw": "estimators.til.law",
    "joint_observer": "estimators.joint.default_observer",
    "make": "estimators.registry",
    "register": "estimators.registry",
    "til_observer": "estimators.til.default_observer",
    "usable": "estimators.registry",
}

__all__ = [
    "ESTIMATORS",
    "BlackBox",
    "Entry",
    "Estimate",
    "Estimator",
    "Given",
    "JointEstimate",
    "JointObserver",
    "JointSettings",
    "Observer",
    "OnlineEstimator",
    "ParameterLaw",
    "joint_observer",
    "make",
    "register",
    "til_observer",
    "usable",
]


def __getattr__(name: str) -> Any:
    """Imports a public name (PEP 562)."""
    if name not in _PLACES:
        raise AttributeError(f"module 'estimators' has no attribute {name!r}")
    return getattr(import_module(_PLACES[name]), name)


def __dir__() -> list[str]:
    return sorted([*globals(), *_PLACES])
