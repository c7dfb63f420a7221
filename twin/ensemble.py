"""Several twins of one vehicle side by side, for observers that compare them."""

from twin.car.vehicle import Vehicle
from twin.car_record import new_cars
from twin.errors import TwinError
from twin.twin import Twin


class Ensemble:
    """Twins of one vehicle whose cars lie in one array, so that one compiled loop steps them all.

    Attributes:
        vehicle: what each simulates.
        twins: the owners of what `cars` points to.
        cars: (n,) records, `cars[i]` the same car as `twins[i].car`; valid as long as this object
            lives.

    Raises:
        TwinError: fewer than one twin.
    """

    def __init__(self, vehicle: Vehicle, size: int) -> None:
        if size < 1:
            raise TwinError(f"ensemble: size is {size}; allowed: at least 1")
        self.vehicle = vehicle
        self.cars = new_cars(size)
        self.twins = tuple(Twin(vehicle, self.cars[i : i + 1]) for i in range(size))

    def __len__(self) -> int:
        """Number of twins."""
        return len(self.twins)

    def __reduce__(self) -> str:
        raise TwinError("an Ensemble owns memory of MuJoCo and cannot be pickled; send its Vehicle")
