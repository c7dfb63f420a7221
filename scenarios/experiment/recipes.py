"""What an estimator of the registry is given on a car that no experiment names it for."""

from collections.abc import Mapping

from scenarios.experiment import laws, sideslip_and_mass, truck
from scenarios.experiment.experiment import Recipe

_SUV = {
    "til": Recipe(estimator="til", laws=laws.ALL_LAWS),
    "til-paper": Recipe(estimator="til-paper", laws=laws.ALL_PAPER_LAWS),
    "staged": Recipe(estimator="staged", laws=laws.ALL_LAWS),
}
# By the twin's car; a plant that is no car has none
RECIPES: Mapping[str, Mapping[str, Recipe]] = {
    "suv": _SUV,
    "sports_car": sideslip_and_mass.RECIPES,
    "bmw_320i": sideslip_and_mass.RECIPES,
    "": truck.RECIPES,
}


def recipe_of(estimator: str, car: str) -> Recipe:
    """The recipe of an estimator for a twin's car; by default a twin and the sensors' noise."""
    return RECIPES.get(car, {}).get(estimator, Recipe(estimator=estimator))
