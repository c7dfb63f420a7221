"""The black box: a vehicle in MuJoCo, its tyres, loads, sensors and recorded drives."""
