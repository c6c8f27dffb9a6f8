#!/usr/bin/env python3
"""Writes the datasets of this folder, and `expected.json`: what other programs find in them.

    pip install pycolmap==4.2.1 opencv-python-headless==5.0.0.93 numpy==2.4.6 && python3 make.py

| folder | written by | expected values by |
|---|---|---|
| `colmap_binary`, `colmap_text` | pycolmap 4.2.1 | pycolmap, and OpenCV where it has the lens |
| `nerfstudio_opencv`, `nerfstudio_fisheye` | NumPy 2.4.6 | OpenCV 5.0.0 |
| `n3v` | NumPy | the conversion of LLFF's loader, and OpenCV |

Out: for each view its name, time, size, position, the lens of its pinhole camera, and points of the world with their pixels in the distorted image (the
middle of the first pixel is 0.5, 0.5). The points lie behind the middles of pixels of the pinhole camera, so that a test finds in one pixel of an
undistorted image where it was sampled: images are stripes of one pixel, from which both coordinates follow. The first image of the datasets of
nerfstudio is smooth, and `undistorted.png` is what OpenCV makes of it.
"""

import json
import shutil
from pathlib import Path

import cv2
import numpy as np
import pycolmap

HERE = Path(__file__).parent
OPENGL = np.diag([1.0, -1.0, -1.0, 1.0])
# Pixels of the points, as fractions of width and height.
PLACES = [(0.08, 0.1), (0.91, 0.12), (0.5, 0.52), (0.22, 0.85), (0.88, 0.9), (0.15, 0.4), (0.7, 0.27), (0.45, 0.7)]
# Model, width, height, parameters, names of the images.
CAMERAS = [
    ("SIMPLE_PINHOLE", 40, 32, [31, 19.2, 16.9], ["simple_pinhole_a.png", "simple_pinhole_b.png"]),
    ("PINHOLE", 36, 44, [33, 35, 17.1, 22.8], ["pinhole_a.png", "pinhole_b.png"]),
    ("SIMPLE_RADIAL", 40, 32, [32, 20.6, 15.4, -0.12], ["simple_radial_a.png", "simple_radial_b.png"]),
    ("RADIAL", 44, 36, [34, 22.7, 17.5, 0.09, 0.03], ["radial_a.png", "radial_b.png"]),
    ("OPENCV", 40, 32, [30, 33, 20.9, 15.2, -0.15, 0.03, 0.004, -0.003], ["opencv/0003.png", "opencv/0009.png"]),
    ("OPENCV_FISHEYE", 40, 32, [22, 23, 19.1, 16.8, 0.03, -0.02, 0.02, -0.03], ["fisheye/0004.png"]),
    ("FULL_OPENCV", 44, 36, [32, 30, 21.2, 18.9, 0.05, -0.04, -0.002, 0.003, 0.02, 0.12, 0.03, 0.01],
     ["full_opencv_a.png", "full_opencv_b.png"]),
    ("SIMPLE_FISHEYE", 40, 32, [23, 19.4, 16.3], ["simple_fisheye_a.png"]),
    ("FISHEYE", 44, 36, [24, 26, 22.4, 17.6], ["plain_fisheye_a.png"]),
    ("SIMPLE_RADIAL_FISHEYE", 40, 32, [24, 20.7, 15.3, -0.03], ["rig_left/0006.png", "rig_left/0033.png"]),
    ("RADIAL_FISHEYE", 36, 44, [25, 18.8, 21.1, 0.02, -0.015], ["rig_right/0006.png", "rig_right/0033.png"]),
]
# Frames of `fisheye` that are on disk, of which the model has the first. The rig has the last two cameras.
FRAMES, RIG, FIRST = ["0004", "0006", "0018"], (10, 11), 3


def pose(index):
    """Returns the matrix from the world to a camera with OpenCV axes, which looks past the origin and is turned about its axis."""
    angle = 0.37 * index
    position = np.array([4.5 * np.sin(angle), 0.9 * np.sin(2.3 * angle + 1), 4.5 * np.cos(angle)])
    forward = np.array([0.3 * np.cos(index), 0.2, 0.1 * index % 0.5]) - position
    forward /= np.linalg.norm(forward)
    right = np.cross(forward, [0.0, 1.0, 0.0])
    right /= np.linalg.norm(right)
    turn = cv2.Rodrigues(np.array([0.0, 0.0, 0.4 + 0.9 * index]))[0]
    matrix = np.eye(4)
    matrix[:3, :3] = turn @ np.array([right, np.cross(forward, right), forward])
    matrix[:3, 3] = -matrix[:3, :3] @ position
    return matrix


def save(path, image):
    path.parent.mkdir(parents=True, exist_ok=True)
    cv2.imwrite(str(path), np.rint(image[..., ::-1]).astype(np.uint8), [cv2.IMWRITE_PNG_COMPRESSION, 9])


def stripes(path, size):
    """Red has stripes along y, green along x; blue tells which stripe it is."""
    x, y = np.meshgrid(np.arange(size[0]), np.arange(size[1]))
    save(path, np.dstack([28 + 200 * (x % 2), 28 + 200 * (y % 2), 3 * x + 2 * y]))


def smooth(path, size):
    x, y = np.meshgrid(np.arange(size[0]) + 0.5, np.arange(size[1]) + 0.5)
    wave = lambda a, b, c: 128 + 60 * np.sin(a * x + b * y) + 50 * np.sin(c * x - 0.3 * y + 1)
    save(path, np.dstack([wave(0.35, 0.1, 0.15), wave(0.1, 0.4, 0.2), wave(0.25, 0.25, 0.1)]))


def zoom(project, focal, center, size):
    """Returns the smallest factor of the focal lengths, to 1/4096, at which the border of the pinhole image is inside the distorted image."""
    t = np.arange(4) / 4
    ones, zeros = np.ones(4), np.zeros(4)
    border = np.concatenate([np.stack(side, 1) for side in [(t, zeros), (ones, t), (1 - t, ones), (zeros, 1 - t)]]) * size

    def is_inside(factor):
        plane = (border - center) / (focal * factor)
        at = project(np.column_stack([plane, np.ones(16)]))
        return bool(np.all(at >= -1e-7) and np.all(at <= size + 1e-7))

    low, high = 1.0, 2.0
    if is_inside(low):
        return low
    assert is_inside(high)
    for _ in range(12):
        middle = (low + high) / 2
        low, high = (low, middle) if is_inside(middle) else (middle, high)
    return high


def view(name, time, size, to_camera, focal, center, project):
    """Returns what is expected of a view. `project` gives the distorted pixels of points in the space of the camera."""
    size, center = np.array(size), np.array(center, float)
    pinhole = np.array(focal, float) * zoom(project, np.array(focal, float), center, size)
    rotation, translation = to_camera[:3, :3], to_camera[:3, 3]
    pixels = np.floor(np.array(PLACES) * size) + 0.5
    depths = 2 + np.arange(len(pixels)) * 0.6
    seen = np.column_stack([(pixels - center) / pinhole, np.ones(len(pixels))]) * depths[:, None]
    world = np.round((seen - translation) @ rotation, 5)
    distorted = project(world @ rotation.T + translation)
    assert np.all(distorted > 1) and np.all(distorted < size - 1), (name, distorted)
    rounded = lambda values, digits=6: np.round(values, digits).tolist()
    return {
        "name": name, "time": round(time, 7), "size": size.tolist(), "position": rounded(-rotation.T @ translation),
        "focal": rounded(pinhole), "center": rounded(center),
        "points": [[rounded(at), rounded(pixel, 4)] for at, pixel in zip(world, distorted)],
    }


def opencv(focal, center, coefficients, fisheye):
    """Returns OpenCV's projection of points in the space of the camera."""
    matrix = np.array([[focal[0], 0, center[0]], [0, focal[1], center[1]], [0, 0, 1.0]])
    nowhere, coefficients = np.zeros(3), np.array(coefficients, float)

    def project(points):
        points = np.array(points, float).reshape(-1, 1, 3)
        if fisheye:
            return cv2.fisheye.projectPoints(points, nowhere, nowhere, matrix, coefficients)[0].reshape(-1, 2)
        return cv2.projectPoints(points, nowhere, nowhere, matrix, coefficients)[0].reshape(-1, 2)

    return project


def rigid(matrix):
    return pycolmap.Rigid3d(matrix[:3])


def colmap():
    model = pycolmap.Reconstruction()
    cameras, poses = {}, {}
    for number, (name, width, height, parameters, _) in enumerate(CAMERAS, 1):
        cameras[number] = pycolmap.Camera(camera_id=number, model=name, width=width, height=height, params=parameters)
        if number in RIG:
            model.add_camera(cameras[number])
        else:
            model.add_camera_with_trivial_rig(cameras[number])
    right_from_left = np.eye(4)
    right_from_left[:3, :3] = cv2.Rodrigues(np.array([0.1, -0.5, 0.2]))[0]
    right_from_left[:3, 3] = [-0.7, 0.1, 0.2]
    rig = pycolmap.Rig(rig_id=RIG[0])
    rig.add_ref_sensor(cameras[RIG[0]].sensor_id)
    rig.add_sensor(cameras[RIG[1]].sensor_id, rigid(right_from_left))
    model.add_rig(rig)
    images = [(camera, name) for camera, (*_, names) in enumerate(CAMERAS, 1) for name in names]
    points = np.round([[np.sin(3 * i), 0.8 * np.cos(2 * i), 0.7 * np.sin(5 * i + 1)] for i in range(12)], 3)
    frames = {}
    for number, (camera, name) in enumerate(images, 1):
        # The images of every third number have no points.
        keypoints = [] if number % 3 == 0 else [[1.5 + i, 2.5 + number] for i in range(4)]
        image = pycolmap.Image(name=name, keypoints=np.array(keypoints).reshape(-1, 2), camera_id=camera, image_id=number)
        if camera not in RIG:
            model.add_image_with_trivial_frame(image, rigid(pose(number)))
            continue
        frame_name = name.split("/")[1]
        frames.setdefault(frame_name, []).append(image)
    for members in frames.values():
        frame = pycolmap.Frame(frame_id=members[0].image_id, rig_id=RIG[0], rig_from_world=rigid(pose(members[0].image_id)))
        for image in members:
            frame.add_data_id(image.data_id)
        model.add_frame(frame)
        for image in members:
            image.frame_id = frame.frame_id
            model.add_image(image)
        model.register_frame(frame.frame_id)
    for index, point in enumerate(points):
        # Points 8 and later have no observations.
        seen_by = [(number, index % 4) for number in ([1, 4] if index < 4 else [2, 5, 7] if index < 8 else [])]
        track = pycolmap.Track([pycolmap.TrackElement(image, at) for image, at in seen_by])
        model.add_point3D(point, track, np.array([20 * index, 255 - 17 * index, 7 * index * index % 256], np.uint8))
    for folder in ["colmap_binary/sparse/0", "colmap_text/sparse"]:
        (HERE / folder).mkdir(parents=True)
    model.write_binary(str(HERE / "colmap_binary/sparse/0"))
    model.write_text(str(HERE / "colmap_text/sparse"))

    models = [pycolmap.Reconstruction(), pycolmap.Reconstruction()]
    models[0].read_binary(str(HERE / "colmap_binary/sparse/0"))
    models[1].read_text(str(HERE / "colmap_text/sparse"))
    views = []
    for image in models[0].images.values():
        camera, to_camera = image.camera, np.vstack([image.cam_from_world().matrix(), [0, 0, 0, 1]])
        same = models[1].find_image_with_name(image.name)
        assert np.abs(same.cam_from_world().matrix() - to_camera[:3]).max() < 1e-12 and same.camera.params.tolist() == camera.params.tolist()
        size = (camera.width, camera.height)
        focal, center = (camera.focal_length_x, camera.focal_length_y), (camera.principal_point_x, camera.principal_point_y)
        rest = camera.params[len(camera.focal_length_idxs()) + 2:].tolist()
        fisheye = "FISHEYE" in camera.model_name
        # OpenCV has the same lenses, in which missing coefficients are zero.
        other = opencv(focal, center, rest + [0] * (4 - len(rest)) if len(rest) < 4 else rest, fisheye)
        stem = image.name[:-4].replace("/", "_")
        folder = image.name.split("/")[0] if "/" in image.name else None
        names = [f"fisheye/{frame}.png" for frame in FRAMES] if folder == "fisheye" else [image.name]
        for name in names:
            stripes(HERE / "colmap_binary/images" / name, size)
            time = (int(name[-8:-4]) - FIRST) / 30 if folder else 0.0
            found = view(name[:-4].replace("/", "_"), time, size, to_camera, focal, center, camera.img_from_cam)
            assert np.allclose(image.projection_center(), found["position"], atol=1e-6)
            for at, pixel in found["points"]:
                assert np.allclose(image.project_point(at), pixel, atol=1e-4), (name, "pycolmap")
                assert np.allclose(other(to_camera @ [*at, 1] @ np.eye(4, 3)), pixel, atol=1e-4), (name, "OpenCV")
            views.append(found)
    cloud = [[point.xyz.tolist(), point.color.tolist()] for _, point in sorted(models[1].points3D.items())]
    assert len(cloud) == 12
    return {"views": sorted(views, key=lambda view: view["name"]), "cloud": cloud}


def nerfstudio(folder, fisheye):
    size = (32, 24)
    focal, center = ((18.0, 17.0), (16.6, 11.3)) if fisheye else ((26.0, 24.0), (14.9, 12.7))
    names = ["k1", "k2", "k3", "k4"] if fisheye else ["k1", "k2", "p1", "p2", "k3"]
    coefficients = [-0.03, 0.02, -0.02, 0.03] if fisheye else [0.12, 0.03, 0.003, -0.004, 0.01]
    project = opencv(focal, center, coefficients, fisheye)
    frames, views = [], []
    for index in range(3):
        name = f"frame_{index + 1:05}"
        to_camera = pose(30 + index)
        frames.append({"file_path": f"images/{name}.png", "transform_matrix": (np.linalg.inv(to_camera) @ OPENGL).tolist()})
        views.append(view(name, 0.0, size, to_camera, focal, center, project))
        (stripes if index else smooth)(HERE / folder / f"images/{name}.png", size)
    lens = {"w": size[0], "h": size[1], "fl_x": focal[0], "fl_y": focal[1], "cx": center[0], "cy": center[1]}
    model = {"camera_model": "OPENCV_FISHEYE" if fisheye else "OPENCV", **lens, **dict(zip(names, coefficients))}
    (HERE / folder / "transforms.json").write_text(json.dumps({**model, "frames": frames}, indent=1) + "\n")
    # The middle of OpenCV's first pixel is 0, 0.
    matrix = lambda focal: np.array([[focal[0], 0, center[0] - 0.5], [0, focal[1], center[1] - 0.5], [0, 0, 1.0]])
    make = cv2.fisheye.initUndistortRectifyMap if fisheye else cv2.initUndistortRectifyMap
    maps = make(matrix(focal), np.array(coefficients), np.eye(3), matrix(views[0]["focal"]), size, cv2.CV_32FC1)
    image = cv2.imread(str(HERE / folder / "images/frame_00001.png"))
    undone = cv2.remap(image, *maps, cv2.INTER_LINEAR, borderMode=cv2.BORDER_REPLICATE)
    cv2.imwrite(str(HERE / folder / "undistorted.png"), undone, [cv2.IMWRITE_PNG_COMPRESSION, 9])
    views[0]["undistorted"] = f"{folder}/undistorted.png"
    return {"views": views}


def n3v():
    size, focal = (40, 32), 33.0
    rows = []
    for index in range(3):
        matrix = np.linalg.inv(pose(40 + index))
        right, down, forward, position = matrix[:3].T
        rows.append(np.concatenate([np.column_stack([down, right, -forward, position, [size[1], size[0], focal]]).ravel(), [0.5, 20]]))
    (HERE / "n3v").mkdir()
    np.save(HERE / "n3v/poses_bounds.npy", np.array(rows).astype("<f8"))
    # As load_llff_data reads it: the axes become right, up and backwards.
    poses = np.load(HERE / "n3v/poses_bounds.npy")[:, :15].reshape(-1, 3, 5)
    poses = np.concatenate([poses[..., 1:2], -poses[..., :1], poses[..., 2:]], -1)
    views = []
    for place, camera, found in zip(["cam00", "cam01/images", "frames/cam02"], ["cam00", "cam01", "cam02"], poses):
        height, width, focal = found[:, 4]
        to_camera = np.linalg.inv(np.vstack([found[:, :4], [0, 0, 0, 1]]) @ OPENGL)
        for frame, time in [(5, 0.0), (8, 0.1)]:
            size, center = (int(width), int(height)), (width / 2, height / 2)
            stripes(HERE / "n3v" / place / f"{frame:04}.png", size)
            project = opencv((focal, focal), center, [0] * 4, False)
            views.append(view(f"{camera}_{frame:04}", time, size, to_camera, (focal, focal), center, project))
    return {"views": views}


for folder in ["colmap_binary", "colmap_text", "nerfstudio_opencv", "nerfstudio_fisheye", "n3v"]:
    shutil.rmtree(HERE / folder, ignore_errors=True)
expected = {
    "colmap": colmap(),
    "nerfstudio_opencv": nerfstudio("nerfstudio_opencv", False),
    "nerfstudio_fisheye": nerfstudio("nerfstudio_fisheye", True),
    "n3v": n3v(),
}
# A view on each line.
lines = lambda values: "[\n" + ",\n".join(json.dumps(value, separators=(",", ":")) for value in values) + "\n]"
sets = [f'"{name}":{{' + ",".join(f'"{part}":{lines(values)}' for part, values in found.items()) + "}" for name, found in expected.items()]
(HERE / "expected.json").write_text("{\n" + ",\n".join(sets) + "\n}\n")
