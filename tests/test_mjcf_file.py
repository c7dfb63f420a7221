"""MJCF files of strangers: nothing but the file itself is read."""

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
        (with_asset('<mesh file="/etc/passwd"/>'), "element 'mesh' is not allowed"),
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
