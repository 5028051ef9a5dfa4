"""A small convolutional network in NumPy: where the mirror is, and which colour the own body has, in one picture.

Three convolutions make 40 columns of features. A column says whether it shows mirror, and how much it shows of a body
of each colour; the body's colour is the largest over the columns. Nothing tells the network whose body it sees.
"""

import numpy as np

import sight

ROWS = slice(120, 400)  # from the mirror's top at 1.5 m to the feet at 1.6 m
SHRINK = 4
COLUMNS = 40
LAYERS = (("first", 5, 2, 3, 16), ("second", 3, 2, 16, 32), ("third", 3, 1, 32, 32))  # name, size, stride, from, to
SURE = 0.8


def shrunk(picture):
    """The part of a picture that the network sees: 70 x 160 x 3 numbers."""
    part = picture[ROWS].astype(np.float32)
    rows, columns = part.shape[0] // SHRINK, part.shape[1] // SHRINK
    return (part.reshape(rows, SHRINK, columns, SHRINK, 3).mean((1, 3)) / 255 - 0.45) * 4


class Network:
    def __init__(self, weights):
        self.weights = weights

    @classmethod
    def fresh(cls, rng):
        weights = {}
        for name, size, _, entering, leaving in LAYERS:
            fan = size * size * entering
            weights[name] = rng.normal(0, np.sqrt(2 / fan), (fan, leaving)).astype(np.float32)
            weights[name + "_bias"] = np.zeros(leaving, np.float32)
        for name, entering, leaving in (("around", 5 * 64, 24), ("mirror", 24, 1), ("body", 32, sight.NONE)):
            weights[name] = rng.normal(0, np.sqrt(1 / entering), (entering, leaving)).astype(np.float32)
            weights[name + "_bias"] = np.zeros(leaving, np.float32)
        return cls(weights)

    @classmethod
    def load(cls, path):
        with np.load(path) as file:
            if set(file.files) != set(cls.fresh(np.random.default_rng(0)).weights):
                raise ValueError(f"{path} has no weights of this network; train_seeing.py writes such a file")
            return cls({name: file[name].astype(np.float32) for name in file.files})

    def save(self, path):
        np.savez_compressed(path, **{name: weight.astype(np.float16) for name, weight in self.weights.items()})

    def forward(self, pictures):
        """Logits: of mirror by picture and column, and of the colours and no body by picture; and what training needs."""
        kept, layer = [], pictures
        for name, size, stride, _, _ in LAYERS:
            patches = unfolded(layer, size, stride)
            out = patches @ self.weights[name] + self.weights[name + "_bias"]
            kept.append((layer.shape, patches, out > 0))
            layer = np.maximum(out, 0)
        tallest = layer.max(1)
        pooled = np.concatenate((tallest, layer.mean(1)), -1)
        padded = np.pad(pooled, ((0, 0), (2, 2), (0, 0)))
        around = np.concatenate([padded[:, at : at + COLUMNS] for at in range(5)], -1)
        hidden = around @ self.weights["around"] + self.weights["around_bias"]
        mirror = (np.maximum(hidden, 0) @ self.weights["mirror"] + self.weights["mirror_bias"])[..., 0]
        by_column = tallest @ self.weights["body"] + self.weights["body_bias"]
        body = np.concatenate((by_column.max(1), np.zeros((len(pictures), 1), np.float32)), 1)
        return mirror, body, (kept, layer, tallest, around, hidden, by_column)

    def gradients(self, saved, mirror_slope, body_slope):
        """Slopes of the loss by weight, from those by logit."""
        kept, layer, tallest, around, hidden, by_column = saved
        count, slopes = len(layer), {}

        def linear(name, entering, leaving):
            slopes[name] = entering.reshape(-1, entering.shape[-1]).T @ leaving.reshape(-1, leaving.shape[-1])
            slopes[name + "_bias"] = leaving.reshape(-1, leaving.shape[-1]).sum(0)
            return leaving @ self.weights[name].T

        hidden_slope = linear("mirror", np.maximum(hidden, 0), mirror_slope[..., None]) * (hidden > 0)
        around_slope = linear("around", around, hidden_slope).reshape(count, COLUMNS, 5, 64)
        padded = np.zeros((count, COLUMNS + 4, 64), np.float32)
        for at in range(5):
            padded[:, at : at + COLUMNS] += around_slope[:, :, at]
        pooled_slope = padded[:, 2:-2]
        column_slope = np.zeros_like(by_column)
        np.put_along_axis(column_slope, by_column.argmax(1)[:, None], body_slope[:, None, : sight.NONE], 1)
        tallest_slope = pooled_slope[..., :32] + linear("body", tallest, column_slope)
        slope = np.repeat(pooled_slope[:, None, :, 32:] / layer.shape[1], layer.shape[1], 1)
        top = layer.argmax(1)[:, None]
        np.put_along_axis(slope, top, np.take_along_axis(slope, top, 1) + tallest_slope[:, None], 1)
        for (name, size, stride, _, _), (shape, patches, is_on) in reversed(list(zip(LAYERS, kept))):
            slope = linear(name, patches, slope * is_on)
            if name != LAYERS[0][0]:
                slope = folded(slope, shape, size, stride)
        return slopes

    def look(self, view, _mirror):
        """Votes on pieces of wall, and the colour of the body that it takes for its own, by this picture alone."""
        mirror, body, _ = self.forward(shrunk(view.picture)[None])
        chance = 1 / (1 + np.exp(-mirror[0]))
        weights = (chance > SURE).astype(int) - (chance < 1 - SURE)
        wide = view.width // COLUMNS
        votes = view.votes(np.arange(1, view.width, 2) + 0.5, np.repeat(weights, wide // 2))
        share = softmax(body)[0]
        best = int(share.argmax())
        return votes, sight.COLORS[best] if best != sight.NONE and share[best] > SURE else None


def softmax(logits):
    powers = np.exp(logits - logits.max(-1, keepdims=True))
    return powers / powers.sum(-1, keepdims=True)


def unfolded(layer, size, stride):
    """The neighbourhood of each output pixel, with a border of zeros."""
    edge = size // 2
    padded = np.pad(layer, ((0, 0), (edge, edge), (edge, edge), (0, 0)))
    windows = np.lib.stride_tricks.sliding_window_view(padded, (size, size), (1, 2))[:, ::stride, ::stride]
    return np.ascontiguousarray(windows.transpose(0, 1, 2, 4, 5, 3)).reshape(*windows.shape[:3], -1)


def folded(slope, shape, size, stride):
    """The reverse of `unfolded`: adds up what each input pixel gave."""
    edge, (count, rows, columns, channels) = size // 2, shape
    padded = np.zeros((count, rows + 2 * edge, columns + 2 * edge, channels), np.float32)
    parts = slope.reshape(*slope.shape[:3], size, size, channels)
    down, across = slope.shape[1] * stride, slope.shape[2] * stride
    for row in range(size):
        for column in range(size):
            padded[:, row : row + down : stride, column : column + across : stride] += parts[:, :, :, row, column]
    return padded[:, edge : edge + rows, edge : edge + columns]
