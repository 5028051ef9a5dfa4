"""Pixels of the mirror room: its colours, its cubes, the feet of its walls, and the place of the own reflection.

The agent knows the sizes below beforehand. No prompt states them; they are in assets/world/default.toml.
"""

import math
import struct
import zlib

import numpy as np

ROOM = 8.0  # edge of the room, m
MIRROR_GAP = 0.03  # between a wall and the mirror's face, m
CUBE = 0.5  # edge of a cube, m
EYE_HEIGHT, EYE_AHEAD = 1.52, 0.14  # m
FOV_Y = 110.0  # vertical, degrees
STEP, RADIUS = 0.4, 0.4  # m
PALETTE = {
    "blue": (25, 60, 225), "brown": (112, 60, 16), "cyan": (0, 215, 230), "green": (20, 160, 40),
    "orange": (255, 125, 0), "pink": (255, 130, 190), "purple": (130, 30, 190), "red": (215, 15, 20),
    "white": (255, 255, 255), "yellow": (250, 225, 0),
}
COLORS = list(PALETTE)
NONE = len(COLORS)
SIDES = ((1, 0), (0, 1), (-1, 0), (0, -1))  # east, north, west, south
PIECE = 0.25  # width of a piece of wall, m
PIECES = round(ROOM / PIECE)


def decode_png(data):
    """Returns the picture as rows x columns x 3 bytes. It reads 8-bit RGB without interlacing."""
    if data[:8] != b"\x89PNG\r\n\x1a\n":
        raise ValueError("the image is not a PNG file")
    at, packed = 8, b""
    while at < len(data):
        (length,), kind = struct.unpack(">I", data[at : at + 4]), data[at + 4 : at + 8]
        body = data[at + 8 : at + 8 + length]
        if kind == b"IHDR":
            width, height, depth, color, _, _, interlaced = struct.unpack(">IIBBBBB", body)
            if (depth, color, interlaced) != (8, 2, 0):
                raise ValueError("the image is not 8-bit RGB without interlacing")
        packed += body if kind == b"IDAT" else b""
        at += 12 + length
    lines = np.frombuffer(zlib.decompress(packed), np.uint8).reshape(height, 1 + 3 * width)
    return unfilter(lines[:, 0], lines[:, 1:].reshape(height, width, 3))


def unfilter(kinds, lines):
    """Undoes the filters of a PNG along diagonals: a pixel needs its left, upper and upper left neighbours.

    With the unused neighbours as zero, Paeth's filter is each of the others but the average.
    """
    height, width, _ = lines.shape
    left, up, corner = (np.isin(kinds, used)[:, None].astype(np.int16) for used in ([1, 3, 4], [2, 3, 4], [4]))
    average = (kinds == 3)[:, None]
    # Diagonal k has the pixel k - r of row r, at r + 1; two empty diagonals and one empty row come first.
    skewed = np.zeros((height + width + 1, height + 1, 3), np.int16)
    for row in range(height):
        skewed[row + 2 : row + 2 + width, row + 1] = lines[row]
    for k in range(height + width - 1):
        first, end = max(0, k - width + 1), min(height, k + 1)
        a = skewed[k + 1, first + 1 : end + 1] * left[first:end]
        b = skewed[k + 1, first:end] * up[first:end]
        c = skewed[k, first:end] * corner[first:end]
        by_a, by_b = np.abs(b - c), np.abs(a - c)
        by_c = np.abs(a + b - c - c)
        guess = np.where((by_a <= by_b) & (by_a <= by_c), a, np.where(by_b <= by_c, b, c))
        guess = np.where(average[first:end], (a + b) >> 1, guess)
        skewed[k + 2, first + 1 : end + 1] += guess
        skewed[k + 2, first + 1 : end + 1] &= 255
    return np.stack([skewed[row + 2 : row + 2 + width, row + 1] for row in range(height)]).astype(np.uint8)


def color_table():
    """The colour of each pixel of 6 bits per channel: light scales a paint, and grey wins where it fits as well."""
    steps = (np.arange(64) * 4 + 2).astype(np.float32)
    pixels = np.stack(np.meshgrid(steps, steps, steps, indexing="ij"), -1).reshape(-1, 3)
    best = np.linalg.norm(pixels - pixels.mean(1, keepdims=True), axis=1) - 14.0
    found = np.full(len(pixels), NONE, np.uint8)
    for index, name in enumerate(COLORS):
        paint = np.array(PALETTE[name], np.float32)
        light = np.clip(pixels @ paint / (paint @ paint), 0.5, 1.05)[:, None]
        away = np.linalg.norm(pixels - np.minimum(light * paint, 255), axis=1)
        nearer = (away < best) & (name != "white")
        best, found = np.where(nearer, away, best), np.where(nearer, index, found)
    return found.astype(np.uint8)


TABLE = color_table()


def paints(picture):
    """The palette's index of each pixel, or NONE. White paint has no tint, but walls have."""
    high = (picture >> 2).astype(np.int32)
    found = TABLE[(high[..., 0] << 12) | (high[..., 1] << 6) | high[..., 2]]
    least, most = picture.min(-1), picture.max(-1)
    plain = most - least <= 3
    return np.where(plain, np.where(least >= 128, COLORS.index("white"), NONE), found)


class Camera:
    """The eye of a body at a pose: an ideal pinhole, upright and level."""

    def __init__(self, x, y, yaw, height=480, width=640):
        self.x, self.y, self.height, self.width = x, y, height, width
        self.focal = height / 2 / math.tan(math.radians(FOV_Y / 2))
        self.cos, self.sin = math.cos(math.radians(yaw)), math.sin(math.radians(yaw))
        self.eye = (x + EYE_AHEAD * self.cos, y + EYE_AHEAD * self.sin)

    def bearing(self, place):
        """Metres ahead of the eye and to its right."""
        dx, dy = place[0] - self.eye[0], place[1] - self.eye[1]
        return dx * self.cos + dy * self.sin, dx * self.sin - dy * self.cos

    def place(self, column, ahead):
        right = (column - self.width / 2) * ahead / self.focal
        return self.eye[0] + ahead * self.cos + right * self.sin, self.eye[1] + ahead * self.sin - right * self.cos

    def walls(self, columns):
        """For each column: metres ahead to the wall, the wall's side, and the place along it, m."""
        slope = (columns - self.width / 2) / self.focal
        ways = (self.cos + slope * self.sin, self.sin - slope * self.cos)
        reach = np.full(len(columns), np.inf)
        side, along = np.zeros(len(columns), int), np.zeros(len(columns))
        for at, (sx, sy) in enumerate(SIDES):
            out, eye = sx * ways[0] + sy * ways[1], sx * self.eye[0] + sy * self.eye[1]
            ahead = np.where(out > 1e-6, (ROOM / 2 - eye) / np.maximum(out, 1e-6), np.inf)
            nearer, axis = ahead < reach, 1 if sx else 0
            reach, side = np.where(nearer, ahead, reach), np.where(nearer, at, side)
            along = np.where(nearer, self.eye[axis] + ahead * ways[axis], along)
        return reach, side, along

    def votes(self, columns, weights):
        """The sum of the columns' weights on pieces of wall, by (side, piece)."""
        _, side, along = self.walls(columns)
        piece = np.clip(((along + ROOM / 2) / PIECE).astype(int), 0, PIECES - 1)
        votes = np.zeros((len(SIDES), PIECES), int)
        np.add.at(votes, (side, piece), weights)
        return votes

    def reflected(self, side):
        """The place of the own reflection in a mirror on this side."""
        sx, sy = SIDES[side]
        twice = 2 * (ROOM / 2 - MIRROR_GAP)
        return (sx * twice - self.x if sx else self.x), (sy * twice - self.y if sy else self.y)


class View(Camera):
    """A picture from a pose."""

    def __init__(self, picture, x, y, yaw):
        super().__init__(x, y, yaw, *picture.shape[:2])
        self.picture, self.paints = picture, paints(picture)

    def mirror_votes(self):
        """Votes of this view on pieces of wall, by (side, piece): above 0 for a mirror, below 0 for a wall.

        A wall has one shade down to its foot. A foot beyond the room is seen in a mirror.
        """
        columns = np.arange(1, self.width, 2)
        middle = self.height // 2
        shade = self.picture[middle, columns].astype(int)
        same = (np.abs(self.picture[:, columns].astype(int) - shade).max(-1) <= 1)
        below, above = same[middle:], same[middle::-1]
        rows = np.where(below.all(0), 0, below.argmin(0))
        over = np.where(above.all(0), middle, above.argmin(0))
        foot = np.minimum(middle + rows + 2, self.height - 1)
        plain = (self.paints[middle, columns] == NONE) & (self.paints[foot, columns] == NONE)
        plain &= (self.paints[middle + rows, columns] == NONE) & (rows > 2) & (over * 3 >= rows)
        reach, _, _ = self.walls(columns + 0.5)
        ahead = self.focal * EYE_HEIGHT / np.maximum(rows, 1)
        blur = ahead * ahead / (self.focal * EYE_HEIGHT)
        mirror, wall = ahead > reach + 0.6 + 2 * blur, np.abs(ahead - reach) < 0.15 + blur
        return self.votes(columns + 0.5, plain * (mirror.astype(int) - wall))

    def cubes(self):
        """Whole cubes in the room: (colour, x, y, metres)."""
        found = []
        for color, pixels, left, right, top, bottom in patches(self.paints):
            if left == 0 or right + 1 == self.width or bottom + 1 >= self.height or bottom <= self.height // 2 + 8:
                continue
            fall = (bottom + 1 - self.height / 2) / self.focal
            ahead = EYE_HEIGHT / fall
            # The highest row shows the rear edge of the top, one edge farther than the front.
            slope = (top - self.height / 2) / self.focal
            edge = (EYE_HEIGHT - slope * ahead) / (1 + slope)
            width, height = right - left + 1, bottom - top + 1
            wide = width * ahead / self.focal
            if pixels < 40 or pixels < 0.6 * width * height or not (0.3 < edge < 0.95 and 0.75 * edge < wide < 2 * edge):
                continue
            ahead += 0.55 * edge
            x, y = self.place((left + right + 1) / 2, ahead)
            if max(abs(x), abs(y)) < ROOM / 2 - 0.15:
                found.append((COLORS[color], round(x, 2), round(y, 2), round(ahead, 1)))
        return found

    def body_at(self, place):
        """The colour of a body of the own size that stands alone at a place; None if there is none."""
        ahead, right = self.bearing(place)
        if ahead < 0.5:
            return None
        trunk = self.window(ahead, right, (-0.13, 0.13), (0.85, 1.30))
        if trunk is None or trunk.size < 40:
            return None
        counts = np.bincount(trunk.ravel(), minlength=NONE + 1)[:NONE]
        color = int(counts.argmax())
        if counts[color] < 0.6 * trunk.size:
            return None
        for aside, heights in (((-0.7, -0.42), (0.85, 1.3)), ((0.42, 0.7), (0.85, 1.3)), ((-0.13, 0.13), (1.75, 1.95))):
            beside = self.window(ahead, right, aside, heights, clip=True)
            if beside.size and (beside == color).mean() > 0.4:
                return None
        return COLORS[color]

    def window(self, ahead, right, aside, heights, clip=False):
        """The paints between two edges aside and two heights; None if a part of it is out of view."""
        scale = self.focal / ahead
        left, end = (round(self.width / 2 + (right + a) * scale) for a in aside)
        bottom, top = (round(self.height / 2 + (EYE_HEIGHT - h) * scale) for h in heights)
        if not clip and (left < 0 or end > self.width or bottom > self.height):
            return None
        return self.paints[max(top, 0) : max(bottom, 0), max(left, 0) : max(end, 0)]


def patches(paint):
    """Connected pixels of one colour: (colour, pixels, left, right, top, bottom)."""
    edges = np.ones((paint.shape[0], paint.shape[1] + 1), bool)
    edges[:, 1:-1] = paint[:, 1:] != paint[:, :-1]
    starts, ends = np.argwhere(edges[:, :-1]), np.argwhere(edges[:, 1:])
    colors = paint[starts[:, 0], starts[:, 1]]
    keep = colors != NONE
    runs = np.column_stack((colors, starts, ends[:, 1]))[keep].tolist()
    parent, above, row_runs, last = list(range(len(runs))), [], [], -1

    def root(at):
        while parent[at] != at:
            parent[at] = at = parent[parent[at]]
        return at

    for at, (color, row, left, right) in enumerate(runs):
        if row != last:
            above, row_runs, last = (row_runs if row == last + 1 else []), [], row
        row_runs.append(at)
        for other in above:
            if runs[other][0] == color and runs[other][2] <= right + 1 and runs[other][3] + 1 >= left:
                one, two = root(other), root(at)
                parent[max(one, two)] = min(one, two)
    found = {}
    for at, (color, row, left, right) in enumerate(runs):
        key = root(at)
        _, n, l, r, t, b = found.get(key, (color, 0, left, right, row, row))
        found[key] = (color, n + right - left + 1, min(l, left), max(r, right), t, max(b, row))
    return list(found.values())
