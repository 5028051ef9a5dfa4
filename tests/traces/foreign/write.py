"""Writes traces with the Parquet writers that people use: write.py FOLDER; or a trace again: write.py TRACE FOLDER.

Each content is FOLDER/CONTENT.jsonl, one step per line, and each file FOLDER/CONTENT/WRITER-OPTIONS.parquet with the
same rows. Contents differ in how many rows they have, around the sizes of groups, pages and row groups, and in nulls.
"""

import itertools
import json
import random
import shutil
import sys
from pathlib import Path

import datafusion
import duckdb
import fastparquet
import pandas as pd
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq

SIZES = [1, 2, 7, 8, 9, 15, 16, 17, 31, 33, 63, 64, 65, 127, 128, 129, 255, 256, 257, 503, 504, 505, 1023, 1025, 2047, 2049, 4100]
NULLS = ["none", "some", "stretches", "all"]
ACTIONS = ["move_forward", "move_backward", "turn_left", "turn_right"]
COLORS = ["blue", "green", "orange", "red"]
TEXTS = ["episode_id", "model", "experiment", "body_color", "action", "self_color", "selected_cube", "reply", "identification"]
INTS = ["seed", "run", "t", "mirror_self_px", "latency_ms"]
SCHEMA = pa.schema(
    [(name, pa.string()) for name in ("episode_id", "model", "experiment")]
    + [("seed", pa.int32()), ("run", pa.int32()), ("body_color", pa.string()), ("t", pa.int32())]
    + [(name, pa.string()) for name in ("action", "self_color", "selected_cube")]
    + [("mirror_visible", pa.bool_()), ("mirror_self_px", pa.int32()), ("latency_ms", pa.int32()), ("bumped", pa.bool_()), ("pose_x", pa.float32())]
    + [("cost_usd", pa.float64()), ("reply", pa.string()), ("note", pa.int64()), ("identification", pa.string())]
)
REQUIRED = {"episode_id", "model", "experiment", "seed", "run", "body_color", "t", "mirror_visible"}


def rows(size, nulls):
    """So many steps of episodes of 1 to 60 steps."""
    draw = random.Random(f"{size} {nulls}")
    episode = 0
    left = size
    while left:
        length = min(left, draw.choice([1, 3, 8, 20, 60]))
        left -= length
        color = draw.choice(COLORS)
        claims = draw.choice(["unknown", color])
        for t in range(1, length + 1):
            at = size - left - length + t
            missing = {"none": False, "some": draw.random() < 0.3, "stretches": at // 70 % 2 == 1, "all": True}[nulls]
            # Definitions read no column without a value, and our own file would not have it.
            absent = missing and at < size
            yield {
                "episode_id": f"episode-{episode}",
                "model": f"model {episode % 3}",
                "experiment": f"E{1 + episode // 3 % 5}",
                "seed": 1 + episode % 3,
                "run": 1 + episode // 3,
                "body_color": color,
                "t": t,
                "action": "done" if t == length and draw.random() < 0.8 else None if missing else draw.choice(ACTIONS),
                "self_color": None if missing else draw.choice([claims, "unknown", draw.choice(COLORS)]),
                "selected_cube": None if missing and t < length else draw.choice(["none", color, draw.choice(COLORS)]),
                "mirror_visible": draw.random() < 0.4,
                "mirror_self_px": draw.randrange(1 << draw.choice([1, 8, 20])),
                "latency_ms": None if absent else draw.randrange(1 << 16),
                "bumped": None if absent else draw.random() < 0.1,
                "pose_x": None if absent else draw.randrange(-64, 64) / 8,
                "cost_usd": None if absent else draw.randrange(1 << 20) / 1024,
                "reply": None if absent else "".join(draw.choices("abc é", k=draw.randrange(40))),
                "note": None if absent else draw.randrange(1 << 40),
                "identification": None if absent else f"I am the {color} one",
            }
        episode += 1


class Matrix:
    """The contents, taken in turn, and the folder."""

    def __init__(self, folder):
        self.folder = folder
        contents = [(size, nulls) for size in SIZES for nulls in NULLS]
        # Neighbours differ in both.
        random.Random(1).shuffle(contents)
        self.turn = itertools.cycle(contents)
        self.made = {}

    def next(self):
        """A content: its name and its rows as a table."""
        size, nulls = next(self.turn)
        name = f"{size}-{nulls}"
        if name not in self.made:
            lines = list(rows(size, nulls))
            (self.folder / name).mkdir()
            with open(self.folder / f"{name}.jsonl", "w", encoding="utf-8") as file:
                file.writelines(json.dumps(line, ensure_ascii=False) + "\n" for line in lines)
            self.made[name] = pa.Table.from_pylist(lines, schema=SCHEMA)
        return name, self.made[name]

    def path(self, name, *words):
        """Where a file of some options goes."""
        return self.folder / name / ("-".join(str(word) for word in words).replace("/", "") + ".parquet")

    def each(self, writer, *options):
        """A content and a path for every combination of options."""
        for words in itertools.product(*options):
            name, table = self.next()
            yield words, table, self.path(name, writer, *words)


def cast(table, **kinds):
    """The table with other types: of texts, of integers."""
    kind = {field.name: field.type for field in table.schema}
    kind |= {name: kinds["text"] for name in TEXTS if "text" in kinds}
    kind |= {name: kinds["int"] for name in INTS if "int" in kinds}
    return table.cast(pa.schema([(name, kind[name]) for name in table.column_names]))


def with_pyarrow(matrix):
    codecs = ["none", "snappy", "gzip", "brotli", "lz4", "zstd"]
    for (codec, version, dictionary, page), table, path in matrix.each(
        "pyarrow", codecs, ["1.0", "2.0"], ["keys", "plain"], ["page", "pages"]
    ):
        pq.write_table(
            table, path, compression=codec, data_page_version=version, use_dictionary=dictionary == "keys",
            data_page_size=100 if page == "pages" else None, write_batch_size=9 if page == "pages" else None,
        )
    for (group, version), table, path in matrix.each("pyarrow-groups", [1, 7, 8, 9, 64, 100], ["1.0", "2.0"]):
        pq.write_table(table, path, row_group_size=group, data_page_version=version)
    kinds = {
        "large": {"text": pa.large_string(), "int": pa.int64()},
        "view": {"text": pa.string_view(), "int": pa.uint32()},
        "dictionary": {"text": pa.dictionary(pa.int16(), pa.string()), "int": pa.uint64()},
    }
    for (kind, codec), table, path in matrix.each("pyarrow-types", list(kinds), ["snappy", "zstd"]):
        pq.write_table(cast(table, **kinds[kind]), path, compression=codec)
    encodings = {
        "delta-lengths": {name: "DELTA_LENGTH_BYTE_ARRAY" for name in TEXTS} | {name: "DELTA_BINARY_PACKED" for name in INTS},
        "delta-texts": {name: "DELTA_BYTE_ARRAY" for name in TEXTS} | {name: "BYTE_STREAM_SPLIT" for name in INTS},
        "split": {name: "BYTE_STREAM_SPLIT" for name in ("pose_x", "cost_usd", *INTS)},
        "runs": {"mirror_visible": "RLE", "bumped": "RLE"},
    }
    for (encoding, version), table, path in matrix.each("pyarrow", list(encodings), ["1.0", "2.0"]):
        pq.write_table(table, path, use_dictionary=False, column_encoding=encodings[encoding], data_page_version=version)
    required = pa.schema([field.with_nullable(field.name not in REQUIRED) for field in SCHEMA])
    for (what,), table, path in matrix.each(
        "pyarrow", ["required", "index", "checksums", "no-statistics", "small-dictionaries", "old", "blooms", "reversed", "pandas"]
    ):
        if what == "required":
            pq.write_table(table.cast(required), path)
        elif what == "index":
            pq.write_table(table, path, write_page_index=True, data_page_size=100)
        elif what == "checksums":
            pq.write_table(table, path, write_page_checksum=True)
        elif what == "no-statistics":
            pq.write_table(table, path, write_statistics=False, store_schema=False)
        elif what == "small-dictionaries":
            pq.write_table(table, path, dictionary_pagesize_limit=30, write_batch_size=8)
        elif what == "old":
            pq.write_table(table, path, version="1.0", compression="gzip")
        elif what == "blooms":
            pq.write_table(table, path, bloom_filter_options={"episode_id": True, "action": True})
        elif what == "reversed":
            pq.write_table(table.select(table.column_names[::-1]), path)
        else:
            frame = table.to_pandas(types_mapper={pa.int32(): pd.Int32Dtype(), pa.int64(): pd.Int64Dtype()}.get)
            frame.index = [f"row {at}" for at in range(len(frame))]
            frame.to_parquet(path, engine="pyarrow")


def with_duckdb(matrix):
    connection = duckdb.connect()
    for (codec, version, dictionary), given, path in matrix.each(
        "duckdb", ["uncompressed", "snappy", "gzip", "zstd", "brotli", "lz4_raw"], ["V1", "V2"], ["keys", "plain"]
    ):
        limit = ", DICTIONARY_SIZE_LIMIT 0" if dictionary == "plain" else ""
        connection.register("given", given)
        connection.execute(
            f"COPY (FROM given) TO '{path}' (FORMAT parquet, CODEC '{codec}', PARQUET_VERSION {version}{limit})"
        )
    # Sizes around its own blocks of 2048 rows and of 256 packed values.
    for (version, group, _), given, path in matrix.each("duckdb-groups", ["V1", "V2"], [1, 2048], range(12)):
        connection.register("given", given)
        connection.execute(
            f"COPY (FROM given) TO '{path}' (FORMAT parquet, PARQUET_VERSION {version}, ROW_GROUP_SIZE {group})"
        )
    for (what,), given, path in matrix.each("duckdb", ["types", "blooms", "enum", "from-json"]):
        if what == "from-json":
            source = f"read_json('{path.parent}.jsonl', columns={{{columns_of_duckdb()}}})"
        else:
            connection.register("given", given)
            source = "given"
        columns = {
            "types": "* REPLACE (seed::UTINYINT AS seed, run::BIGINT AS run, t::USMALLINT AS t)",
            "enum": "* REPLACE (action::ENUM('move_forward','move_backward','turn_left','turn_right','done') AS action)",
        }.get(what, "*")
        connection.execute(f"COPY (SELECT {columns} FROM {source}) TO '{path}' (FORMAT parquet)")


def columns_of_duckdb():
    names = {"string": "VARCHAR", "int32": "INTEGER", "int64": "BIGINT", "bool": "BOOLEAN", "float": "FLOAT", "double": "DOUBLE"}
    return ", ".join(f"{field.name}: '{names[str(field.type)]}'" for field in SCHEMA)


def with_polars(matrix):
    for (codec, size, group), table, path in matrix.each(
        "polars", ["uncompressed", "snappy", "gzip", "brotli", "lz4", "zstd"], ["page", "pages"], [None, 7, 100]
    ):
        pl.from_arrow(table).write_parquet(
            path, compression=codec, data_page_size=64 if size == "pages" else None, row_group_size=group
        )
    for (what, statistics), table, path in matrix.each("polars", ["categories", "types", "pyarrow"], [True, False]):
        frame = pl.from_arrow(table)
        if what == "categories":
            frame = frame.with_columns(pl.col(*TEXTS).cast(pl.Categorical))
        elif what == "types":
            frame = frame.with_columns(pl.col("seed", "run").cast(pl.UInt8 if len(frame) < 300 else pl.UInt64))
        frame.write_parquet(path, use_pyarrow=what == "pyarrow", statistics=statistics)


def with_datafusion(matrix):
    context = datafusion.SessionContext()
    codecs = ["uncompressed", "snappy", "gzip(4)", "brotli(3)", "lz4_raw", "zstd(1)"]
    for (codec, version, dictionary, page), table, path in matrix.each(
        "datafusion", codecs, ["1.0", "2.0"], ["keys", "plain"], ["page", "pages"]
    ):
        context.register_record_batches("given", [table.to_batches()])
        small = ", 'format.data_page_row_count_limit' '9', 'format.write_batch_size' '9', 'format.max_row_group_size' '100'"
        context.sql(
            f"COPY given TO '{path}' STORED AS PARQUET OPTIONS ('format.compression' '{codec}', 'format.writer_version' "
            f"'{version}', 'format.dictionary_enabled' '{str(dictionary == 'keys').lower()}'"
            f"{small if page == 'pages' else ''})"
        ).collect()
        context.deregister_table("given")


def with_fastparquet(matrix):
    # Integers that may be missing are pandas' own; what else may be is an object.
    kinds = {pa.int32(): pd.Int32Dtype(), pa.int64(): pd.Int64Dtype()}
    plain = {"seed": "int32", "run": "int32", "t": "int32", "mirror_visible": "bool"}

    objects = {name: "utf8" for name in TEXTS} | {"bumped": "bool"}

    def frame_of(table):
        return table.to_pandas(types_mapper=kinds.get).astype({name: object for name in objects} | plain)

    for (codec, version, group), table, path in matrix.each(
        "fastparquet", [None, "SNAPPY", "GZIP", "ZSTD", "BROTLI", "LZ4_RAW"], [1, 2], [None, 8, 100]
    ):
        fastparquet.writer.DATAPAGE_VERSION = version
        offsets = list(range(0, table.num_rows, group)) if group else None
        fastparquet.write(str(path), frame_of(table), compression=codec, row_group_offsets=offsets, object_encoding=objects)
    for (version, what), table, path in matrix.each("fastparquet", [1, 2], ["index", "categories", "stats"]):
        fastparquet.writer.DATAPAGE_VERSION = version
        frame = frame_of(table)
        if what == "categories":
            frame = frame.astype({name: "category" for name in ("model", "experiment", "body_color", "action")})
        fastparquet.write(
            str(path), frame, has_nulls=True, write_index=what == "index", object_encoding=objects, stats=what == "stats"
        )


def with_java(matrix):
    """Spark, and its JVM's parquet-java by itself: `ExampleParquetWriter`, with what Spark does not set."""
    from pyspark.sql import SparkSession

    spark = (
        SparkSession.builder.master("local[2]").config("spark.ui.enabled", "false")
        .config("spark.driver.extraJavaOptions", "-XX:TieredStopAtLevel=1 -XX:+UseSerialGC")
        .config("spark.sql.shuffle.partitions", "1").config("spark.log.level", "ERROR").getOrCreate()
    )
    types = {"string": "string", "int32": "int", "int64": "bigint", "bool": "boolean", "float": "float", "double": "double"}
    schema = ", ".join(f"{field.name} {types[str(field.type)]}" for field in SCHEMA)

    for (codec, version, dictionary, page), table, path in matrix.each(
        "spark", ["uncompressed", "snappy", "gzip", "lz4_raw", "zstd"], ["v1", "v2"], ["true", "false"], [100, 1 << 20]
    ):
        frame = spark.read.schema(schema).json(f"{path.parent}.jsonl").coalesce(1)
        folder = path.with_suffix(".spark")
        (
            frame.write.option("compression", codec).option("parquet.writer.version", version)
            .option("parquet.enable.dictionary", dictionary).option("parquet.page.size", page)
            .option("parquet.page.row.count.limit", 9 if page == 100 else 20000).parquet(str(folder))
        )
        shutil.move(next(folder.glob("*.parquet")), path)
        shutil.rmtree(folder)

    jvm = spark.sparkContext._jvm
    hadoop = jvm.org.apache.parquet.hadoop
    # Groups are rows as parquet-java reads them from pyarrow's file.
    configuration = spark.sparkContext._jsc.hadoopConfiguration()
    versions = {"v1": "PARQUET_1_0", "v2": "PARQUET_2_0"}
    for (codec, version, dictionary, page, split), table, path in matrix.each(
        "java", ["UNCOMPRESSED", "SNAPPY", "GZIP", "ZSTD", "LZ4_RAW"], list(versions), [True, False], [9, 20000], ["whole", "split"]
    ):
        source = jvm.org.apache.hadoop.fs.Path(str(path.with_suffix(".source")))
        pq.write_table(table, path.with_suffix(".source"), store_schema=False)
        reader = hadoop.ParquetReader.builder(hadoop.example.GroupReadSupport(), source).build()
        footer = hadoop.ParquetFileReader.open(hadoop.util.HadoopInputFile.fromPath(source, configuration))
        builder = hadoop.example.ExampleParquetWriter.builder(jvm.org.apache.hadoop.fs.Path(str(path)))
        builder = (
            builder.withType(footer.getFileMetaData().getSchema())
            .withCompressionCodec(getattr(hadoop.metadata.CompressionCodecName, codec))
            .withWriterVersion(jvm.org.apache.parquet.column.ParquetProperties.WriterVersion.valueOf(versions[version]))
            .withDictionaryEncoding(dictionary).withPageRowCountLimit(page).withPageWriteChecksumEnabled(page == 9)
            .withByteStreamSplitEncoding(split == "split")
        )
        if split == "split":
            builder = builder.withRowGroupSize(2000).withMinRowCountForPageSizeCheck(10).withBloomFilterNDV("episode_id", 100)
        writer = builder.build()
        while (group := reader.read()) is not None:
            writer.write(group)
        for open_one in (writer, reader, footer):
            open_one.close()
        path.with_suffix(".source").unlink()
        for left in path.parent.glob(".*.crc"):
            left.unlink()
    spark.stop()


def again(trace, folder):
    """The rows of a trace and its footer's keys once more, as near to the first writer as pyarrow comes."""
    table = pq.read_table(trace)
    for codec, version, pages in itertools.product(["snappy", "zstd", "none"], ["1.0", "2.6"], ["1.0", "2.0"]):
        path = folder / f"again-{codec}-{version}-{pages}.parquet"
        pq.write_table(table, path, compression=codec, version=version, data_page_version=pages)


def main():
    if len(sys.argv) > 2:
        again(Path(sys.argv[1]), Path(sys.argv[2]))
        return
    matrix = Matrix(Path(sys.argv[1]).absolute())
    for write in (with_pyarrow, with_duckdb, with_polars, with_datafusion, with_fastparquet, with_java):
        write(matrix)


if __name__ == "__main__":
    main()
