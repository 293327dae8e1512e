"""Rotations between a body's frame (x forward, y left, z up) and the local one.

An attitude is heading, pitch and roll: R = Rz(heading) Ry(-pitch) Rx(roll), where heading counts counter-clockwise from
local x, pitch > 0 is nose up and roll > 0 is right side down. Matrices map body vectors to local ones.
"""

import numpy as np
from numpy.typing import ArrayLike

from .arrays import Float


def rotation_matrix(heading: ArrayLike, pitch: ArrayLike = 0.0, roll: ArrayLike = 0.0) -> Float:
    """Return the rotation matrices (..., 3, 3) of attitudes (...), rad; the three are broadcast.

    Example:
        >>> import numpy as np
        >>> (rotation_matrix(np.pi / 2) @ np.array([1.0, 0.0, 0.0])).round(6).tolist()
        [0.0, 1.0, 0.0]
    """
    h, p, r = np.broadcast_arrays(*(np.asarray(angle, dtype=np.float64) for angle in (heading, pitch, roll)))
    (ch, cp, cr), (sh, sp, sr) = (np.cos(h), np.cos(p), np.cos(r)), (np.sin(h), np.sin(p), np.sin(r))
    matrix = np.empty((*h.shape, 3, 3))
    matrix[..., 0, 0], matrix[..., 1, 0], matrix[..., 2, 0] = ch * cp, sh * cp, sp
    matrix[..., 0, 1] = -ch * sp * sr - sh * cr
    matrix[..., 1, 1] = -sh * sp * sr + ch * cr
    matrix[..., 2, 1] = cp * sr
    matrix[..., 0, 2] = -ch * sp * cr + sh * sr
    matrix[..., 1, 2] = -sh * sp * cr - ch * sr
    matrix[..., 2, 2] = cp * cr
    return matrix


def wrap_angle(angle: ArrayLike) -> Float:
    """Return angles (...), rad, wrapped to the range from -pi to pi."""
    value = np.asarray(angle, dtype=np.float64)
    return np.asarray(value - 2.0 * np.pi * np.round(value / (2.0 * np.pi)))


def quaternions(matrix: Float) -> Float:
    """Return unit quaternions (N, 4), scalar first, of rotation matrices (N, 3, 3), by Shepperd's method (1978).

    The largest of the four components is found first, so that nothing is divided by a small number.
    """
    diagonal = matrix[:, [0, 1, 2], [0, 1, 2]]
    trace = diagonal.sum(axis=1)
    squares = np.column_stack([1.0 + trace, 1.0 + 2.0 * diagonal - trace[:, None]])  # four times each square
    # Row k holds the products of component k with all four, times four.
    products = np.empty((len(matrix), 4, 4))
    products[:, [0, 1, 2, 3], [0, 1, 2, 3]] = squares
    for k, (i, j) in enumerate(((1, 2), (2, 0), (0, 1)), 1):
        products[:, 0, k] = products[:, k, 0] = matrix[:, j, i] - matrix[:, i, j]
        products[:, i + 1, j + 1] = products[:, j + 1, i + 1] = matrix[:, i, j] + matrix[:, j, i]
    row = products[np.arange(len(matrix)), squares.argmax(axis=1)]
    return np.asarray(row / np.linalg.norm(row, axis=1, keepdims=True))


def quaternion_matrices(quaternion: Float) -> Float:
    """Return the rotation matrices (N, 3, 3) of unit quaternions (N, 4), scalar first."""
    w, x, y, z = quaternion.T
    rows = [
        [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
        [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
        [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
    ]
    return np.moveaxis(np.array(rows), 2, 0)


def angle_between(from_quaternions: Float, to_quaternions: Float) -> Float:
    """Return the angles (N,), rad, of the shortest turns between unit quaternions (N, 4)."""
    nearer_sign = to_quaternions * np.where((from_quaternions * to_quaternions).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    # By the chord, which is exact for small angles, where the arc cosine is not.
    return np.asarray(4.0 * np.arcsin(np.minimum(np.linalg.norm(nearer_sign - from_quaternions, axis=1) / 2.0, 1.0)))


def slerp(from_quaternions: Float, to_quaternions: Float, share: Float) -> Float:
    """Return unit quaternions (N, 4) at shares (N,) of the shortest turns from the first to the second ones (N, 4)."""
    half_angle = angle_between(from_quaternions, to_quaternions)[:, None] / 2.0
    nearer_sign = to_quaternions * np.where((from_quaternions * to_quaternions).sum(axis=1) < 0.0, -1.0, 1.0)[:, None]
    share = share[:, None]
    is_small = half_angle < 1e-9
    sine = np.where(is_small, 1.0, np.sin(half_angle))
    from_weight = np.where(is_small, 1.0 - share, np.sin((1.0 - share) * half_angle) / sine)
    to_weight = np.where(is_small, share, np.sin(share * half_angle) / sine)
    blend = from_weight * from_quaternions + to_weight * nearer_sign
    return np.asarray(blend / np.linalg.norm(blend, axis=1, keepdims=True))
