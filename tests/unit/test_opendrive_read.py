"""OpenDRIVE files that are broken or hold more than is read: an error or a finding with its line, never a hang."""

from __future__ import annotations

from time import perf_counter

import numpy as np
import pytest

from scarl_sionna.core.errors import MapError, ScarlError
from scarl_sionna.scene.streets.opendrive.street import read_map
from tests import street_maps as maps

GOOD = maps.street_map(
    maps.road(
        maps.piece("<line/>", 50.0),
        50.0,
        more='<objects><object id="1" type="pole" s="3" t="6" height="4" radius="0.1"/></objects>'
        '<signals><signal id="7" s="40" t="-5" zOffset="2" orientation="+" dynamic="yes" type="1000001"/></signals>',
    )
)


def _line(text: str, part: str) -> int:
    return text[: text.index(part)].count("\n") + 1


def _read(folder, text):
    file = folder / "map.xodr"
    file.write_text(text) if isinstance(text, str) else file.write_bytes(text)
    return read_map(file)


def test_what_a_file_says(tmp_path):
    street = _read(tmp_path, GOOD)
    road = street.roads["1"]
    assert (street.version, road.length, list(road.sections[0].lanes)) == ((1, 7), 50.0, [-1, 1])
    assert road.objects[0].size == (0.0, 0.0, 4.0, 0.1) and road.signals[0].is_dynamic
    assert street.findings == ()


@pytest.mark.parametrize(
    ("old", "new", "words"),
    [
        ('length="50.0" id', 'length="fifty" id', "is no number"),
        ('length="50.0" id', 'length="nan" id', "outside"),
        ('length="50.0" id', 'length="-1" id', "outside"),
        ('id="1" junction', 'name2="1" junction', "has no 'id'"),
        ('rule="RHT"', 'rule="UP"', "RHT and LHT"),
        ("<line/>", "", "holds 0 of line"),
        ("<line/>", "<arc curvature='9e5'/>", "turns by more than"),
        ('<lane id="-1"', '<lane id="-2"', "number them 1, 2, 3"),
        ('<lane id="1"', '<lane id="-4"', "left lanes have ids above 0"),
        ('<lane id="1"', '<lane id="one"', "is no whole number"),
        ('revMajor="1"', 'revMajor="2"', "versions 1.4 to 1.8"),
        ('<laneSection s="0.0">', '<laneSection s="60">', "has no <laneSection> of any length"),
        ('s="3" t="6"', 't="6"', "has no 's'"),
    ],
)
def test_a_wrong_value_is_an_error_with_its_line(tmp_path, old, new, words):
    text = GOOD.replace(old, new, 1)
    assert text != GOOD
    with pytest.raises(MapError, match=words) as caught:
        _read(tmp_path, text)
    assert caught.value.line is not None and abs(caught.value.line - _line(GOOD, old)) <= 4
    assert f"line {caught.value.line}:" in str(caught.value)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("", "not valid XML"),
        ("<OpenDRIVE>", "not valid XML"),
        ("<scene/>", "not <OpenDRIVE>"),
        ("<OpenDRIVE/>", "holds no road"),
        ('<!DOCTYPE a [<!ENTITY b "c">]><OpenDRIVE/>', "document type"),
        ("<OpenDRIVE>" + "<a>" * 200 + "</a>" * 200 + "</OpenDRIVE>", "inside each other"),
        (GOOD.replace("</road>", "</road>" + GOOD[GOOD.index("<road ") : GOOD.index("</OpenDRIVE>")]), "stands twice"),
    ],
)
def test_a_broken_file_is_a_typed_error(tmp_path, text, words):
    with pytest.raises(MapError, match=words):
        _read(tmp_path, text)


def test_no_file(tmp_path):
    with pytest.raises(MapError, match="not found"):
        read_map(tmp_path / "none.xodr")


def test_what_is_not_used_is_found_with_its_line_and_once_a_kind(tmp_path):
    text = GOOD.replace("<objects>", '<railroad>\n<switch id="1"/></railroad>\n<objects>').replace(
        'radius="0.1"/>', 'radius="0.1"><userData code="a"/>\n<userData code="b"/></object>'
    )
    found = _read(tmp_path, text).findings
    assert [str(one) for one in found] == [
        f"line {_line(text, '<railroad>')}: <railroad> in <road> is not used",
        f"line {_line(text, '<userData')}: <userData> in <object> is not used (and on 1 more lines)",
    ]


def test_damaged_bytes_never_end_in_another_error_nor_hang(tmp_path):
    generator = np.random.default_rng(5)
    data = np.frombuffer(GOOD.encode(), np.uint8)
    started = perf_counter()
    for _ in range(400):
        own = data.copy()
        places = generator.integers(0, len(own), generator.integers(1, 6))
        own[places] = generator.integers(32, 127, len(places))
        try:
            _read(tmp_path, own[: generator.integers(len(own) // 2, len(own) + 1)].tobytes())
        except ScarlError:
            continue
    assert perf_counter() - started < 20.0
