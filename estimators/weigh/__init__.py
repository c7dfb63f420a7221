"""The mass of a car from ordinary driving: force at the wheels against the car's own accelerometer.

`trip` holds what is measured, `samples` selects what may be used, `regression` finds the apparent
mass of one trip, `losses` what all trips of a car share, `scatter` how trips differ, `calibration`
puts these together from reference trips, `weighing` applies them to a new trip.
"""
