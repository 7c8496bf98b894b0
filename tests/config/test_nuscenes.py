"""Statistics of nuScenes' tables: small ones whose truth is known by hand, and one too large to hold as objects."""

import json
import math
import re
import tracemalloc

import numpy as np
import pytest

import jrcjax
from jrcjax.config import nuscenes

pytest.importorskip("ijson", reason="needs the extra 'nuscenes'")

QUARTER_TURN = [math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)]  # facing +y
CATEGORIES = {
    "car": "vehicle.car",
    "adult": "human.pedestrian.adult",
    "child": "human.pedestrian.child",
    "stroller": "human.pedestrian.stroller",
    "truck": "vehicle.truck",
}


def annotation(sample, instance, x, y, length=4.0, width=2.0):
    """A row as the schema documents it; size is width, length, height."""
    return {
        "token": f"{sample}-{instance}", "sample_token": sample, "instance_token": instance,
        "attribute_tokens": [], "visibility_token": "4", "translation": [x, y, 1.0], "size": [width, length, 1.5],
        "rotation": [1.0, 0.0, 0.0, 0.0], "num_lidar_pts": 3, "num_radar_pts": 0, "prev": "", "next": "",
    }  # fmt: skip


def tables():
    """Three samples: the vehicle at (1000, 500) facing +x, the same facing +y, and one without objects."""
    data = [
        ("s1", "p1", "cal-lidar", True),
        ("s1", "wrong", "cal-lidar", False),
        ("s1", "wrong", "cal-camera", True),
        ("s2", "p2", "cal-lidar", True),
        ("s3", "p1", "cal-lidar", True),
    ]
    poses = {"p1": [1.0, 0.0, 0.0, 0.0], "p2": QUARTER_TURN, "wrong": [1.0, 0.0, 0.0, 0.0]}
    return {
        "sensor": [
            {"token": "lidar", "channel": "LIDAR_TOP", "modality": "lidar"},
            {"token": "camera", "channel": "CAM_FRONT", "modality": "camera"},
        ],
        "calibrated_sensor": [
            {"token": f"cal-{name}", "sensor_token": name, "translation": [0, 0, 0], "rotation": [1, 0, 0, 0]}
            for name in ("lidar", "camera")
        ],
        "sample": [{"token": f"s{i}", "timestamp": i, "scene_token": "x", "prev": "", "next": ""} for i in (1, 2, 3)],
        "sample_data": [
            {
                "token": f"d{i}", "sample_token": sample, "ego_pose_token": pose, "calibrated_sensor_token": sensor,
                "is_key_frame": key_frame, "filename": "", "fileformat": "pcd", "timestamp": i,
            }
            for i, (sample, pose, sensor, key_frame) in enumerate(data)
        ],
        "ego_pose": [
            {"token": token, "translation": [0.0 if token == "wrong" else 1000.0, 500.0, 0.0], "rotation": rotation}
            for token, rotation in poses.items()
        ],
        "category": [{"token": f"c-{kind}", "name": name, "description": ""} for kind, name in CATEGORIES.items()],
        "instance": [
            {"token": name, "category_token": f"c-{name.rstrip('12')}", "nbr_annotations": 1}
            for name in ("car1", "car2", "adult", "child", "stroller", "truck")
        ],
        "sample_annotation": [
            annotation("s1", "car1", 1010.0, 510.0, length=4.0, width=1.8),
            annotation("s1", "car2", 980.0, 500.0, length=5.0, width=2.0),  # behind
            annotation("s1", "adult", 1030.0, 500.0, length=0.7, width=0.6),  # 30 m ahead
            annotation("s1", "truck", 1001.0, 500.0),
            annotation("s1", "stroller", 1001.0, 500.0),
            annotation("s2", "car1", 1010.0, 510.0, length=4.0, width=1.8),  # 10 m ahead, 10 m to the right
            annotation("s2", "car2", 980.0, 540.0, length=5.0, width=2.0),  # 40 m ahead, 20 m to the left
            annotation("s2", "child", 1000.0, 522.0, length=0.5, width=0.4),  # 22 m ahead
        ],
    }  # fmt: skip


def write(folder, content):
    for name, rows in content.items():
        (folder / f"{name}.json").write_text(json.dumps(rows, indent=0))
    return folder


@pytest.mark.parametrize(
    ("square", "cars", "pedestrians"),
    [
        # Within 22.5 m: both cars of the first sample, the first of the second; only the child.
        ("around", [(4.0, 1.8), (5.0, 2.0), (4.0, 1.8)], [(0.5, 0.4)]),
        # Up to 45 m ahead and 22.5 m to each side: what is behind drops out, what is far ahead comes in.
        ("ahead", [(4.0, 1.8), (4.0, 1.8), (5.0, 2.0)], [(0.7, 0.6), (0.5, 0.4)]),
    ],
)
def test_small_tables_by_hand(square, cars, pedestrians, tmp_path):
    found = nuscenes.traffic(write(tmp_path, tables()), square)
    assert found.samples == 3
    assert found.counted == (len(cars), len(pedestrians))
    assert found.mean_count == (len(cars) / 3, len(pedestrians) / 3)
    np.testing.assert_allclose(found.size_mean, [np.mean(cars, axis=0), np.mean(pedestrians, axis=0)])
    np.testing.assert_allclose(found.size_std, [np.std(cars, axis=0), np.std(pedestrians, axis=0)], atol=1e-7)


def test_the_square_turns_with_the_vehicle(tmp_path):
    """30 m along the global x axis is ahead of a vehicle that faces it, and to the right of one that faces +y."""
    content = tables()
    content["sample_annotation"] = [
        row
        for sample in ("s1", "s2")
        for row in (annotation(sample, "car1", 1030.0, 500.0), annotation(sample, "adult", 1001.0, 501.0))
    ]
    assert nuscenes.traffic(write(tmp_path, content), "ahead").counted == (1, 2)


def test_the_file_is_an_environment(tmp_path, capsys):
    folder, out = write(tmp_path, tables()), tmp_path / "out.toml"
    assert nuscenes.main([str(folder), "--square", "ahead", "--out", str(out)]) == 0
    assert capsys.readouterr().out.strip() == str(out)
    text = out.read_text()
    assert "ahead of the ego vehicle" in text
    assert "1 cars, 0.6667 pedestrians" in text
    params = jrcjax.load_params(out)
    radar, paper = params.radar, jrcjax.paper_params("target")
    np.testing.assert_allclose(radar.density, 5 / 3, rtol=1e-6)
    np.testing.assert_allclose(radar.class_share, [0.6, 0.4], rtol=1e-6)
    np.testing.assert_allclose(radar.size_mean, [[13 / 3, 5.6 / 3], [0.6, 0.5]], rtol=1e-6)
    np.testing.assert_allclose(radar.size_std, [[math.sqrt(2) / 3, 0.2 * math.sqrt(2) / 3], [0.1, 0.1]], rtol=1e-5)
    np.testing.assert_array_equal(params.speed.prior, paper.speed.prior)
    np.testing.assert_array_equal(radar.slope, paper.radar.slope)


def test_standard_output(tmp_path, capsys):
    assert nuscenes.main([str(write(tmp_path, tables()))]) == 0
    assert 'environment = "target"' in capsys.readouterr().out


def without(table, *columns):
    def change(content):
        content[table] = [{k: v for k, v in row.items() if k not in columns} for row in content[table]]

    return change


def with_value(table, number, column, value):
    def change(content):
        content[table][number][column] = value

    return change


def missing(table):
    return lambda content: content.pop(table)


def emptied(table, rows=()):
    return lambda content: content.update({table: list(rows)})


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (missing("sample_annotation"), "sample_annotation.json: 'missing'; allowed: a folder with nuScenes' tables"),
        (missing("sensor"), "sensor.json: 'missing'"),
        (without("sample_annotation", "size"), "sample_annotation.json: row 0: \"no column 'size'\""),
        (without("ego_pose", "rotation"), "ego_pose.json: row 0: \"no column 'rotation'\""),
        (without("sample_data", "is_key_frame"), "sample_data.json: row 0: \"no column 'is_key_frame'\""),
        (
            with_value("sample_annotation", 3, "sample_token", "s9"),
            "row 3: sample_token: 's9'; allowed: the token of a",
        ),
        (with_value("sample_annotation", 0, "instance_token", "i9"), "row 0: instance_token: 'i9'"),
        (with_value("sample_annotation", 0, "instance_token", ["car1"]), "row 0: instance_token: \"['car1']\""),
        (with_value("instance", 1, "category_token", "c9"), "instance.json: row 1: category_token: 'c9'"),
        (with_value("sample_data", 0, "sample_token", "s9"), "sample_data.json: row 0: sample_token: 's9'"),
        (with_value("sample_data", 0, "calibrated_sensor_token", "x"), "row 0: calibrated_sensor_token: 'x'"),
        (with_value("sample_data", 0, "ego_pose_token", "p9"), "sample_data.json: ego_pose_token: 'p9'"),
        (
            with_value("sample_data", 0, "is_key_frame", False),
            "sample.json: token: 's1'; allowed: a sample with a lidar",
        ),
        (with_value("calibrated_sensor", 0, "sensor_token", "x"), "calibrated_sensor.json: row 0: sensor_token: 'x'"),
        (
            with_value("sample_annotation", 0, "size", [1.0, 2.0]),
            "row 0: size: '[1.0, 2.0]'; allowed: a list of 3 finite",
        ),
        (with_value("sample_annotation", 0, "translation", "here"), "row 0: translation: 'here'; allowed: a list of 3"),
        (with_value("ego_pose", 0, "rotation", [1, 0, 0]), "ego_pose.json: row 0: rotation: '[1, 0, 0]'"),
        (emptied("sample"), "sample.json: 'no rows'"),
        (emptied("sample", [3]), "sample.json: row 0: \"no column 'token'\""),
        (emptied("sample_annotation", [annotation("s1", "car1", 1000.0, 500.0)]), "'no pedestrians in range'"),
        (with_value("ego_pose", 0, "translation", [math.nan, 0.0, 0.0]), "ego_pose.json: 'no JSON after row -1: "),
        (
            emptied("category", [{"token": f"c-{kind}", "name": kind} for kind in CATEGORIES]),  # Lyft's are like these
            "category.json: name: 'no cars among adult, car, child, stroller, truck'; allowed: vehicle.car",
        ),
    ],
)
def test_what_is_wrong_with_a_table_is_said(change, message, tmp_path, capsys):
    content = tables()
    change(content)
    with pytest.raises(ValueError, match=re.escape(message)):
        nuscenes.traffic(write(tmp_path, content))
    assert nuscenes.main([str(tmp_path)]) == 2
    assert "error: " in capsys.readouterr().err


def test_a_cut_file_is_an_error(tmp_path):
    path = write(tmp_path, tables()) / "sample_annotation.json"
    path.write_text(path.read_text()[:-300])
    with pytest.raises(ValueError, match=r"sample_annotation\.json: 'no JSON after row [4-6]: [^\n]*'; allowed"):
        nuscenes.traffic(tmp_path)


def test_a_byte_order_mark_is_skipped(tmp_path):
    found = nuscenes.traffic(write(tmp_path, tables()))
    for path in tmp_path.glob("*.json"):
        path.write_bytes(b"\xef\xbb\xbf" + path.read_bytes())
    assert nuscenes.traffic(tmp_path) == found


def test_the_folder_above_the_tables_is_an_error_that_names_them(tmp_path):
    inner = tmp_path / "v1.0-mini"
    inner.mkdir()
    write(inner, tables())
    with pytest.raises(ValueError, match=re.escape(f"perhaps {inner}")):
        nuscenes.traffic(tmp_path)


def test_an_unknown_square_is_refused_before_anything_is_read(tmp_path):
    with pytest.raises(ValueError, match="square: 'behind' is unknown; allowed: 'around', 'ahead'"):
        nuscenes.traffic(tmp_path / "nowhere", "behind")


def test_large_tables_are_not_held_in_memory(tmp_path):
    """Twice as many annotations take no more memory, and 20,000 take less than a fifth of their file."""
    peaks = []
    for annotations in (10_000, 20_000):
        content = tables()
        few = content.pop("sample_annotation")
        write(tmp_path, content)
        with (tmp_path / "sample_annotation.json").open("w") as file:
            file.write("[" + json.dumps(few[-1]))
            for i in range(annotations):
                file.write(",\n" + json.dumps(annotation("s1", "car1", 1000.0, 500.0, length=4.0 + i % 2)))
            file.write("]")
        tracemalloc.start()
        found = nuscenes.traffic(tmp_path)
        peaks.append(tracemalloc.get_traced_memory()[1])
        tracemalloc.stop()
        assert found.counted == (annotations, 1)
        np.testing.assert_allclose(found.size_mean[0], (4.5, 2.0))
        np.testing.assert_allclose(found.size_std[0], (0.5, 0.0), atol=1e-6)
    assert peaks[1] < 1.1 * peaks[0]
    assert peaks[1] < (tmp_path / "sample_annotation.json").stat().st_size / 5
