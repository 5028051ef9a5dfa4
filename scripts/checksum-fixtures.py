#!/usr/bin/env python3
"""Makes fixtures/checksums/: small traces whose pages have checksums, which the parquet crate cannot write.

Needs pyarrow (`pip install pyarrow`). `scripts/checksum-fixtures.py` writes the folder anew; the rows are always the
same, the bytes as the version of pyarrow has them. Not recordings of anything.
"""

from pathlib import Path

import pyarrow as pa
import pyarrow.parquet as pq

FOLDER = Path(__file__).resolve().parent.parent / "fixtures" / "checksums"
ACTIONS = ["turn_left", "turn_right", "move_forward", None, "done"]
COLORS = ["unknown", None, "red", "red", "blue"]


def rows():
    """Six episodes of 9 to 14 steps."""
    for episode in range(6):
        color = ["red", "blue"][episode % 2]
        for t in range(1, 10 + episode):
            yield {
                "episode_id": f"E{1 + episode % 2}-model-{episode}",
                "model": "model",
                "experiment": f"E{1 + episode % 2}",
                "seed": 1,
                "run": episode + 1,
                "body_color": color,
                "t": t,
                "action": ACTIONS[(t * t + episode) % 5],
                "self_color": COLORS[(t + episode) % 5],
                "selected_cube": [None, "none", color][(t // 4) % 3],
                "mirror_visible": (t + episode) % 3 != 0,
                "mirror_px": t * t * 10 if t % 4 else None,
                "cost_usd": t / 64 if t % 5 else None,
                "description": f"step {t * 7919 % 101} of {episode}" if t % 3 else None,
            }


def main():
    schema = pa.schema([
        ("episode_id", pa.string()), ("model", pa.string()), ("experiment", pa.string()), ("seed", pa.int32()),
        ("run", pa.int32()), ("body_color", pa.string()), ("t", pa.int32()), ("action", pa.string()),
        ("self_color", pa.string()), ("selected_cube", pa.string()), ("mirror_visible", pa.bool_()),
        ("mirror_px", pa.int32()), ("cost_usd", pa.float64()), ("description", pa.string()),
    ])
    table = pa.Table.from_pylist(list(rows()), schema=schema)
    # `description`, `cost_usd` and `mirror_px` have no dictionary: the Parquet library decodes them, not the short cut.
    dictionaries = [name for name in schema.names if name not in ("description", "cost_usd", "mirror_px")]
    FOLDER.mkdir(parents=True, exist_ok=True)
    for version, codec, row_group in [("1.0", "snappy", 1000), ("2.0", "zstd", 33), ("1.0", "none", 33)]:
        pq.write_table(
            table, FOLDER / f"v{version[0]}-{codec}.parquet", write_page_checksum=True, data_page_version=version,
            compression=codec, row_group_size=row_group, use_dictionary=dictionaries, store_schema=False,
        )


if __name__ == "__main__":
    main()
