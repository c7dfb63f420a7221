"""MJCF files of strangers: nothing but the file itself is read."""

import re

import pytest

import models
from twin import TwinError, Vehicle

SUV = models.path("suv").read_text()


def refusal(path, text):
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    with pytest.raises(TwinError) as caught:
        Vehicle.load(path).tyres()
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)
    return str(caught.value)


def with_asset(element):
    return SUV.replace("<asset>", f"<asset>{element}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ('<!DOCTYPE m [<!ENTITY a "b">]>' + SUV, "DOCTYPE and entities are not allowed"),
        (SUV.replace("<custom>", '<include file="/etc/passwd"/><custom>'), "element 'include'"),
        (with_asset('<mesh file="/etc/passwd"/>'), "mesh file = '/etc/passwd' is not allowed"),
        (with_asset('<mesh name="m" builtin="sphere"/>'), "mesh builtin = 'sphere' is not allowed"),
        (
            with_asset(
                "".join(
                    f'<texture name="t{i}" type="cube" builtin="flat" width="1024"/>'
                    for i in range(60)
                )
            ),
            "textures have more than 20000000 pixels together",
        ),
        (
            with_asset('<texture name="t" type="2d" width="9" height="9" nchannel="999999999"/>'),
            "textures have more than",
        ),
        (with_asset(f'<mesh name="m" vertex="{"0 1 " * 40_000}"/>'), "meshes have more than 60000"),
        (SUV.replace("</worldbody>", "<site/>" * 3000 + "</worldbody>"), "more than 2000 elements"),
        (SUV.replace("<sensor>", '<sensor><user dim="100000000"/>'), "user dim is '100000000'"),
        (SUV.replace("<gyro ", '<gyro nsample="100000000" '), "gyro nsample is '100000000'"),
        (with_asset('<texture file="a.png" type="2d"/>'), "texture file = 'a.png' is not allowed"),
        (with_asset('<texture fileup="a.png" type="cube"/>'), "texture fileup = 'a.png'"),
        (with_asset('<model file="other.xml"/>'), "element 'model' is not allowed"),
        (SUV.replace("<compiler", '<compiler meshdir="/"', 1), "compiler meshdir = '/'"),
        (SUV.replace("<asset>", '<extension><plugin plugin="a"/></extension><asset>'), "extension"),
        (SUV.replace("</worldbody>", '<replicate count="1000000000"/></worldbody>'), "replicate"),
        (SUV.replace('width="64"', 'width="1000000"'), "texture width is '1000000'; allowed: 0 to"),
        (SUV.replace("<asset>", '<size memory="100G"/><asset>'), "element 'size' is not allowed"),
        (SUV.replace('data="16"', 'size="1000000000"'), "numeric size is '1000000000'; allowed"),
        (SUV.replace('"tyres/suv.tir"', '"/etc/passwd"'), "tyre is '/etc/passwd'; allowed"),
        (SUV.replace('"tyres/suv.tir"', '"../suv.tir"'), "tyre is '../suv.tir'; allowed"),
        (SUV + " " * 1_000_000, "has more than 1000000 bytes"),
        ("<mujoco>" + "<a>" * 200, "nested deeper than 100"),
        ("", "is no XML"),
        (SUV.encode("utf-16"), "is not in UTF-8"),
    ],
)
def test_what_leads_out_of_the_file_or_fills_the_memory_is_refused(tmp_path, text, message):
    assert message in refusal(tmp_path / "car.xml", text)


def test_mesh_with_its_vertices_in_the_file_is_accepted(tmp_path):
    tetrahedron = "0 0 0  1 0 0  0 1 0  0 0 1"
    text = with_asset(f'<mesh name="hood" vertex="{tetrahedron}"/>')
    geom = '<geom name="hood" type="mesh" mesh="hood"/><geom name="bonnet"'
    (tmp_path / "car.xml").write_text(text.replace('<geom name="bonnet"', geom))
    assert Vehicle.load(tmp_path / "car.xml").compile().nmesh == 1


def swapped(pattern, replacement):
    text, found = re.subn(pattern, replacement, SUV)
    assert found, pattern
    return text


HUB = r'(name="hub_\w\w" pos=")(\S+) (\S+) (\S+)"'


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (swapped('axis="0 1 0"', 'axis="0 -1 0"'), "joint spin_fl has axis 0 -1 0; allowed: 0 1 0"),
        (swapped('axis="0 1 0"', 'axis="0 1 0.1"'), "joint spin_fl has axis 0 0.995 0.0995"),
        (
            swapped(HUB, lambda m: f'{m[1]}{-float(m[2])} {m[3]} {m[4]}"'),
            "wheel_fl and wheel_fr are -2.9 m ahead of wheel_rl and wheel_rr",
        ),
        (
            swapped(HUB, lambda m: f'{m[1]}{m[2]} {-float(m[3])} {m[4]}"'),
            "wheel_fl is -1.65 m left of wheel_fr",
        ),
        (swapped('"hub_fl" pos="1.25', '"hub_fl" pos="0.25'), "wheel_fl is -1 m ahead of wheel_fr"),
        (
            swapped('wheel_speed_fl" joint="spin_fl"', 'wheel_speed_fl" joint="spin_rr"'),
            "sensor wheel_speed_fl must measure spin_fl",
        ),
        (swapped("(<gyro [^/]*)/>", r'\1 cutoff="0.05"/>'), "sensor rates has cutoff 0.05"),
        (swapped('gravity="0 0 -9.81"', 'gravity="0 0 -1.62"'), "option gravity is 0 0 -1.62"),
        (swapped('gravity="0 0 -9.81"', 'gravity="0 0 9.81"'), "option gravity is 0 0 9.81"),
        (swapped('gravity="0 0 -9.81"', 'gravity="0.5 0 -9.81"'), "option gravity is 0.5 0"),
        (swapped('<flag contact="disable"', '<flag gravity="disable"'), "option flag gravity must"),
        (swapped('<flag contact="disable"', '<flag spring="disable"'), "option flag spring must"),
        (swapped('<flag contact="disable"', '<flag sensor="disable"'), "option flag sensor must"),
        (swapped('timestep="0.001"', 'timestep="1e-12"'), "option timestep is 1e-12; allowed"),
        (swapped('timestep="0.001"', 'timestep="0.5"'), "option timestep is 0.5; allowed: 1e-05"),
        (swapped('timestep="0.001"', 'timestep="0"'), "timestep"),
        (swapped('<site name="imu"', '<site name="imu" quat="0.9 0.1 0 0"'), "site imu has quat"),
        (
            swapped('name="travel_fl" class="front" axis="[^"]*"',
                    'name="travel_fl" class="front" axis="0 0 -1"'),
            "joint travel_fl has axis 0 0 -1; allowed: upwards",
        ),
        (swapped('"hub_rl"', '"hub_rl" euler="0 0 1.5708"'), "wheel_rl has its axis along -1"),
        (
            swapped('(<joint name="spin_fl")/>', r'\1 pos="0.01 0 0"/>'),
            "wheel_fl: its joint and its mass must stand at its origin",
        ),
        (
            swapped('contact="disable" ', "").replace('contype="0"', 'contype="1"'),
            "option flag contact must be disable",
        ),
    ],
)  # fmt: skip
def test_car_of_wrong_geometry_is_refused_by_name(tmp_path, text, message):
    assert message in refusal(tmp_path / "car.xml", text)
