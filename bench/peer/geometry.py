"""Poses and errors. Transforms are 4x4, `T_target_source`, mm; files map US points to CT points."""
import csv
import math
import pathlib

import numpy as np


def read_T_ct_us(path):
    """Of an ITK transform file with one affine (or matrix offset) transform."""
    fields = {}
    for line in pathlib.Path(path).read_text().splitlines():
        name, separator, value = line.partition(":")
        if separator and not line.startswith("#"):
            if name in fields:
                raise ValueError(f"{path}: holds more than one transform, must hold one")
            fields[name] = value.strip()
    if not fields.get("Transform", "").startswith("AffineTransform_"):
        raise ValueError(f"{path}: 'Transform' is {fields.get('Transform')}, must be affine")
    numbers = [float(word) for word in fields["Parameters"].split()]
    centre = np.array([float(word) for word in fields["FixedParameters"].split()])
    return about_centre(np.reshape(numbers[:9], (3, 3)), numbers[9:12], centre)


def write_T_ct_us(T_ct_us, path):
    numbers = [*T_ct_us[:3, :3].flatten(), *T_ct_us[:3, 3]]
    pathlib.Path(path).write_text(
        "#Insight Transform File V1.0\n#Transform 0\nTransform: AffineTransform_double_3_3\n"
        f"Parameters: {' '.join(map(repr, map(float, numbers)))}\nFixedParameters: 0 0 0\n")


def about_centre(rotation, translation, centre):
    """ITK: p -> rotation (p - centre) + centre + translation."""
    T = np.eye(4)
    T[:3, :3] = rotation
    T[:3, 3] = np.asarray(translation) + centre - T[:3, :3] @ centre
    return T


def rotation_matrix(vector_rad):
    """Rodrigues: about the direction of the vector, by its length."""
    angle = np.linalg.norm(vector_rad)
    if angle == 0.0:
        return np.eye(3)
    x, y, z = np.asarray(vector_rad) / angle
    K = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.eye(3) + math.sin(angle) * K + (1.0 - math.cos(angle)) * K @ K


def euler_matrix(x_rad, y_rad, z_rad):
    """ITK's Euler3DTransform: Rz Rx Ry."""
    return (rotation_matrix([0, 0, z_rad]) @ rotation_matrix([x_rad, 0, 0])
            @ rotation_matrix([0, y_rad, 0]))


def transformed(T, points):
    return points @ T[:3, :3].T + T[:3, 3]


def read_points_mm(path):
    with open(path, newline="") as file:
        rows = list(csv.DictReader(file))
    return np.array([[float(row[axis]) for axis in "xyz"] for row in rows])


def errors_mm(T_ct_us, truth_ct_us, points_us):
    """Target registration errors in the US frame: where the result draws each target's CT point."""
    drawn = transformed(np.linalg.inv(T_ct_us), transformed(truth_ct_us, points_us))
    return np.linalg.norm(drawn - points_us, axis=1)


def draw_start(random, truth_ct_us, points_us, displacement_mm):
    """A wrong T_ct_us, whose mean error at the points is `displacement_mm`.

    Rotation vector (about the points' centroid, degrees) and translation (mm) are drawn from a cube
    and scaled together: in the proportion of +-10 degrees to +-10 mm.
    """
    direction = random.uniform(-1.0, 1.0, 6)
    centroid = points_us.mean(axis=0)

    def start(scale):
        rotation = rotation_matrix(np.radians(scale * direction[:3]))
        return truth_ct_us @ about_centre(rotation, scale * direction[3:], centroid)

    low, high = 0.0, 90.0 / np.linalg.norm(direction[:3])
    for _ in range(60):
        middle = 0.5 * (low + high)
        if errors_mm(start(middle), truth_ct_us, points_us).mean() < displacement_mm:
            low = middle
        else:
            high = middle
    if abs(errors_mm(start(low), truth_ct_us, points_us).mean() - displacement_mm) > 1e-6:
        raise ValueError(f"start displacement is {displacement_mm} mm, must be within reach of "
                         "less than 90 degrees")
    return start(low)
