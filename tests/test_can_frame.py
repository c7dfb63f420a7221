import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from twin.logs.can_frame import FrameDecoder
from twin.logs.can_signals import Database, decode

DBC = """
VERSION ""
BU_: ECU
BO_ 256 Imu: 8 ECU
 SG_ ax : 3|13@1- (0.01,0) [-100|100] "m/s2" ECU
 SG_ ay : 23|16@0- (0.01,0) [-100|100] "m/s2" ECU
 SG_ odd : 34|11@0+ (1,-40) [-40|215] "degC" ECU
 SG_ wide : 52|4@0+ (1,0) [0|15] "" ECU
BO_ 512 Chassis: 8 ECU
 SG_ page M : 0|4@1+ (1,0) [0|15] "" ECU
 SG_ steer m0 : 8|16@1- (0.1,0) [-1000|1000] "deg" ECU
 SG_ speed m1 : 15|16@0+ (0.01,0) [0|650] "km/h" ECU
BO_ 768 Real: 8 ECU
 SG_ torque : 0|32@1- (1,0) [0|0] "N m" ECU
 SG_ other : 39|32@0- (2,1) [0|0] "N m" ECU
SIG_VALTYPE_ 768 torque : 1;
SIG_VALTYPE_ 768 other : 1;
"""


def _database(tmp_path_factory):
    path = tmp_path_factory.mktemp("database") / "car.dbc"
    path.write_text(DBC)
    return Database.load(path)


def test_one_frame_is_decoded_as_the_many_of_a_log(tmp_path_factory):
    database = _database(tmp_path_factory)

    @given(st.sampled_from(sorted(database.messages)), st.binary(max_size=8))
    @settings(max_examples=300, deadline=None)
    def agree(identifier, payload):
        message = database.messages[identifier]
        row = np.frombuffer(payload.ljust(8, b"\0"), dtype=np.uint8)[None]
        wanted, short = decode(message, row, np.array([len(payload)]))
        found, is_short = FrameDecoder(message).decode(payload)
        assert is_short == bool(short)
        assert set(found) == {name for name, value in wanted.items() if np.isfinite(value[0])}
        for name, value in found.items():
            assert value == wanted[name][0]

    agree()
