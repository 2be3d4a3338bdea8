"""Keypoints through files: nothing is lost on the way, other programs' lists are read, bad files are one sentence."""

from __future__ import annotations

import json

import pytest

from gazeloc_core.clicks.keypoint_files import WRITERS, merged, read_keypoints
from gazeloc_core.errors import InputError
from gazeloc_core.keypoints import KeypointPair, KeypointSet, Sighting

PAIRS = KeypointSet(
    (
        KeypointPair("k1", "lamp, left", (1.25, -2.0, 0.1 + 0.2), (0.5, 1e-7, 3.0), enabled=False),
        KeypointPair("k2", "tag “4”", None, (1.0, 2.0, 3.0), (Sighting(3, 10.5, 20.25), Sighting(9, 1.0, 2.0)), 0.01),
        KeypointPair("k3", "corner", (0.0, 1.0, 2.0), None, (), None, True, (Sighting(0, 5.0, 6.0),), None),
    )
)


def through(format_name, keypoints=PAIRS, side="scan"):
    return read_keypoints("file", WRITERS[format_name][1](keypoints).encode(), side)


def test_json_keeps_everything():
    assert through("json") == PAIRS


def test_csv_keeps_names_sides_and_switches_to_the_last_bit():
    assert [(p.name, p.scan, p.sfm, p.enabled) for p in through("csv")] == [
        (p.name, p.scan, p.sfm, p.enabled) for p in PAIRS
    ]


def test_csv_may_leave_out_columns_and_have_them_in_any_order():
    text = "SFM_z,sfm_x, sfm_y,name\n3,1,2,socket\n,,,\n"
    socket, unnamed = read_keypoints("mine.csv", text.encode(), "scan")
    assert (socket.name, socket.scan, socket.sfm, socket.enabled) == ("socket", None, (1, 2, 3), True)
    assert (unnamed.name, unnamed.scan, unnamed.sfm) == ("Point 2", None, None)


@pytest.mark.parametrize("side", ["scan", "sfm"])
def test_lists_of_one_side_put_together_are_the_pairs(side):
    read = through(f"cloudcompare-{side}", side=side)
    expected = [(p.name.replace(",", ""), getattr(p, side)) for p in PAIRS if getattr(p, side)]
    assert [(p.name, getattr(p, side)) for p in read] == expected
    read = through(f"stray-{side}", side=side)
    assert [getattr(p, side) for p in read] == [getattr(p, side) for p in PAIRS if getattr(p, side)]


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("1,2,3\n4,5,6\n", ["Point 1", "Point 2"]),
        ("0,1,2,3\n7,4,5,6\n", ["Point 0", "Point 7"]),
        ("R0,1,2,3\nR1,4,5,6\n", ["Pair 0", "Pair 1"]),
        ("12,A0,1,2,3\n99,A1,4,5,6\n", ["Pair 0", "Pair 1"]),
        ("A0,1,2,3\nR0,4,5,6\n", ["A0", "R0"]),
        ("lamp,1,2,3\nR0,4,5,6\n", ["lamp", "R0"]),
        ("name,x,y,z\nlamp,1,2,3\ndesk,4,5,6\n", ["lamp", "desk"]),
        ("name;X (m);Y (m);Z (m)\nlamp;1;2;3\ndesk;4;5;6\n", ["lamp", "desk"]),
        ("// picked\n1 2 3\n\n4\t5\t6\n", ["Point 1", "Point 2"]),
    ],
)
def test_every_form_of_cloudcompares_list_is_read(text, names):
    read = read_keypoints("list.txt", text.encode(), "scan")
    assert [(p.name, p.scan) for p in read] == list(zip(names, [(1.0, 2.0, 3.0), (4.0, 5.0, 6.0)], strict=True))


def test_what_is_read_completes_pairs_of_the_same_name_and_is_added_else_and_twice_is_once():
    scan = read_keypoints("scan.txt", b"lamp,1,2,3\ndesk,4,5,6\n", "scan")
    sfm = read_keypoints("sfm.txt", b"desk,7,8,9\ndoor,1,1,1\n", "sfm")
    both = merged(merged(PAIRS, scan), sfm)
    assert both.pairs[:3] == PAIRS.pairs
    assert [(p.key, p.name, p.scan, p.sfm) for p in both.pairs[3:]] == [
        ("k4", "lamp", (1, 2, 3), None),
        ("k5", "desk", (4, 5, 6), (7, 8, 9)),
        ("k6", "door", None, (1, 1, 1)),
    ]
    assert merged(merged(both, scan), sfm) == both


def test_of_two_pairs_of_a_name_the_first_gets_what_was_read_and_new_keys_follow_the_highest():
    pairs = [KeypointPair("k7", "lamp", scan=(1, 1, 1)), KeypointPair("k2", "lamp")]
    read = KeypointSet((KeypointPair("k1", "lamp", sfm=(2, 2, 2)), KeypointPair("k2", "desk", scan=(3, 3, 3))))
    after = merged(KeypointSet(tuple(pairs)), read)
    assert [(p.key, p.name, p.scan, p.sfm) for p in after] == [
        ("k7", "lamp", (1, 1, 1), (2, 2, 2)),
        ("k2", "lamp", None, None),
        ("k8", "desk", (3, 3, 3), None),
    ]


def test_the_two_sides_that_cloudcompare_numbers_are_one_pair():
    scan = read_keypoints("ref.txt", b"R0,1,2,3\nR1,4,5,6\n", "scan")
    sfm = read_keypoints("aligned.txt", b"A0,7,8,9\nA1,1,1,1\n", "sfm")
    both = merged(scan, sfm)
    assert [(p.name, p.scan, p.sfm) for p in both] == [
        ("Pair 0", (1, 2, 3), (7, 8, 9)),
        ("Pair 1", (4, 5, 6), (1, 1, 1)),
    ]


CONSOLE = """[22:21:08] [PointPairRegistration] RMS: 0.31
[22:21:09] ; Ref.name; Ref.x; Ref.y; Ref.z; Aligned.name; Aligned.x; Aligned.y; Aligned.z; Delta X; Delta Y; Distance
[22:21:09] ;R0; 558.046; 486.641; 0.939167; A0; 558.482; 486.44; 1.17604; 0.436218; -0.201324; 0.535657
[22:21:09] ;R1; 562.469; 525.639; 1.13067; A1; 562.77; 525.501; 1.36213; 0.301514; -0.138184; 0.404454
[22:21:12] Saved, and a; semicolon
"""


@pytest.mark.parametrize("side", ["scan", "sfm"])
def test_cloudcompares_table_of_pairs_gives_the_side_that_was_not_moved(side):
    read = read_keypoints("console.txt", CONSOLE.encode(), side)
    assert [(p.name, getattr(p, side)) for p in read] == [
        ("Pair 0", (558.046, 486.641, 0.939167)),
        ("Pair 1", (562.469, 525.639, 1.13067)),
    ]
    other = "sfm" if side == "scan" else "scan"
    assert all(getattr(pair, other) is None for pair in read)  # printed as it lies after the alignment


def test_a_table_of_pairs_that_were_not_moved_gives_both_sides():
    text = "ID, ref_X, ref_Y, ref_Z, align_X, align_Y, align_Z\nP01, 1, 2, 3, 4, 5, 6\n"
    (pair,) = read_keypoints("homologous.txt", text.encode(), "scan")
    assert (pair.name, pair.scan, pair.sfm) == ("P01", (1, 2, 3), (4, 5, 6))
    (pair,) = read_keypoints("homologous.txt", text.encode(), "sfm")
    assert (pair.scan, pair.sfm) == ((4, 5, 6), (1, 2, 3))


@pytest.mark.parametrize(
    ("content", "said"),
    [
        (b"", "no keypoint"),
        (b"\xff\xfe\x00", "UTF-8"),
        (b"{", "JSON"),
        (b"[1, 2]", "garbled"),
        (b'[{"key": "k1"}]', "garbled"),
        (b'{"keypoints": 5}', "no list"),
        (b'{"keypoints": [{"position": [1, 2]}]}', "keypoint 1"),
        (b'{"keypoints": [{"position": [1, 2, NaN]}]}', "no place"),
        (b'{"keypoints": [{"position": "abc"}]}', "keypoint 1"),
        (b"1,2\n", "line 1"),
        (b"1,2,3\na,b,c\n", "line 2"),
        (b"1,2,1e30\n", "no place"),
        (b"name,enabled,x\n1,1,1\n", "the column 'x', which is none of name, enabled, scan_x_m"),
        (b"scan_x_m,scan_y_m\n1,1\n", "the header has no column scan_z_m"),
        (b"scan_x_m,scan_y_m,scan_z_m,sfm_y\n1,1,1,1\n", "the header has no column sfm_x"),
        (b"name,scan_x_m,scan_y_m,scan_z_m,name\na,1,1,1,b\n", "the column name twice"),
        (",".join(("name", "enabled", "scan_x_m", "scan_y_m", "scan_z_m", "sfm_x", "sfm_y", "sfm_z")).encode(), "no "),
        (b"name,enabled,scan_x_m,scan_y_m,scan_z_m,sfm_x,sfm_y,sfm_z\na,2,1,2,3,1,2,3\n", "row 2"),
        (b"name,enabled,scan_x_m,scan_y_m,scan_z_m,sfm_x,sfm_y,sfm_z\na,1,1,2,,1,2,3\n", "row 2"),
        (b"name,enabled,scan_x_m,scan_y_m,scan_z_m,sfm_x,sfm_y,sfm_z\na,1,1\n", "row 2"),
        (b"1,2,3\n" * 5001, "5001"),
        (b"1" * 4_000_001, "MB"),
        (b"[" * 100_000, "JSON"),
        (b"name,x,y,z\n", "no keypoint"),
        (b"a,1,2,3\nname,x,y,z\n", "line 2"),
        (CONSOLE.split("\n[22:21:09] ;R0")[0].encode(), "no keypoint"),
        (CONSOLE.replace("486.641", "west").encode(), "line 3"),
        (CONSOLE.replace("; 558.046", "").replace("; A0; 558.482; 486.44; 1.17604", "").encode(), "line 3"),
        (CONSOLE.replace("558.046", "inf").encode(), "no place"),
    ],
)
def test_a_bad_file_is_one_sentence_with_its_name(content, said):
    with pytest.raises(InputError) as caught:
        read_keypoints("bad.file", content, "scan")
    sentence = str(caught.value)
    assert sentence.startswith("bad.file: ")
    assert said in sentence
    assert sentence.count("\n") == 0
    assert len(sentence) < 400


def test_clicks_that_are_none_are_refused():
    pairs = PAIRS.to_json()
    pairs[1]["sightings"][0]["frame_index"] = -1
    with pytest.raises(InputError, match="click"):
        read_keypoints("f.json", json.dumps(pairs).encode(), "scan")
