"""An unscented Kalman filter over the parameters of a black box: its twins are the sigma points.

It looks twice as often as the joint observer, to both sides and as far as the estimate is uncertain
by. See `estimators.unscented_kernel` for the method; the settings are the joint observer's.
"""

import numpy as np
from numpy.typing import ArrayLike

from estimators import unscented_kernel
from estimators.joint import JointEstimate, JointObserver, JointSettings
from estimators.joint_kernel import Log
from twin import OUTPUTS, PARAMETERS, Drive, Fleet, TwinError, Vehicle, check_inputs


def unscented(
    vehicle: Vehicle,
    drive: Drive,
    noise_sd: ArrayLike,
    settings: JointSettings = JointSettings(),  # noqa: B008
    *,
    speed: float,
) -> JointEstimate:
    """Estimates p parameters over a whole drive by 2p + 1 twins.

    Args:
        vehicle: of the twins.
        drive: of N samples.
        noise_sd: (10,) standard deviation of a sample's white noise by channel; NaN: not used.
        settings: what is estimated, and how.
        speed: at the start [m/s].

    Raises:
        TwinError: a name is unknown or given twice, a number is out of range, the drive does not
            fit the twins, or a twin has blown up.
    """
    check_inputs(drive.inputs, "drive")
    joint = JointObserver(vehicle, noise_sd, settings)
    road = drive.inputs[0, 9:13]
    joint.reset(speed, road=road)
    p, n = len(settings.parameters), len(drive)
    fleet = Fleet(vehicle, 2 * p + 1)
    twin = fleet.twins[0]
    setup, memory = joint._setup, joint._memory._replace(
        out=np.zeros((len(fleet), len(OUTPUTS))),
        total=np.zeros((len(fleet), len(OUTPUTS))),
        states=np.zeros((len(fleet), len(twin.states))),
    )
    root, white = np.zeros((p, p)), np.zeros((2 * p, p))
    unscented_kernel.place(fleet.cars, setup, memory, root, white)
    for each in fleet.twins:
        each.reset(speed, road)
    q = memory.z.size
    log = Log(
        states=np.empty((n, len(twin.states))),
        parameters=np.empty((n, len(PARAMETERS))),
        outputs=np.empty((n, len(OUTPUTS))),
        extended=np.empty((n, *twin.car.tyre_output.shape)),
        sd=np.empty((n, q)),
        biases=np.empty((n, q - p)),
    )
    done = unscented_kernel.run(
        fleet.cars, setup, memory, root, white, drive.inputs, drive.measurements, log
    )
    if done < n:
        raise TwinError(f"drive: a twin blew up at t = {drive.time[done]:.3f} s")
    return JointEstimate(
        time=drive.time,
        states=log.states,
        parameters=log.parameters,
        outputs=log.outputs,
        extended=log.extended.reshape(n, -1),
        nominal=setup.nominal.copy(),
        estimated=joint.estimated,
        sd=log.sd,
        biases=log.biases,
        covariance=memory.covariance.copy(),
        information=memory.information.copy(),
    )
