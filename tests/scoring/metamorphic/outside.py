"""Runs many statements over many small folders of traces in one process of another engine.

Usage: outside.py duckdb|spark REQUEST.json

The request is a list of {folder, columns: {name: kind}, statements}; the answer on standard output a list of lists: for each
statement its rows, or the engine's error as text.
"""

import json
import sys

KINDS = {
    "duckdb": {"string": "VARCHAR", "int": "BIGINT", "float": "DOUBLE", "bool": "BOOLEAN"},
    "spark": {"string": "STRING", "int": "BIGINT", "float": "DOUBLE", "bool": "BOOLEAN"},
}


def duckdb_runner():
    import duckdb

    connection = duckdb.connect()
    connection.execute("SET threads = 1")

    def view(case):
        source = f"read_parquet('{case['folder']}/*.parquet', union_by_name = true)"
        there = {row[0] for row in connection.execute(f"DESCRIBE SELECT * FROM {source}").fetchall()}
        text = columns(case, there, "duckdb", '"')
        connection.execute(f"CREATE OR REPLACE VIEW steps AS SELECT {text} FROM {source}")

    return view, lambda statement: [list(row) for row in connection.execute(statement).fetchall()]


def spark_runner():
    from pyspark.sql import SparkSession

    builder = SparkSession.builder.master("local[1]").appName("metamorphic")
    for key, value in {
        "spark.ui.enabled": "false",
        "spark.sql.shuffle.partitions": "1",
        "spark.driver.host": "127.0.0.1",
        "spark.driver.extraJavaOptions": "-XX:TieredStopAtLevel=1 -XX:+UseSerialGC",
        "spark.sql.ansi.enabled": "true",
        "spark.sql.caseSensitive": "true",
        "spark.sql.parser.escapedStringLiterals": "false",
        "spark.sql.codegen.wholeStage": "false",
        "spark.log.level": "OFF",
    }.items():
        builder = builder.config(key, value)
    spark = builder.getOrCreate()

    def view(case):
        traces = spark.read.option("mergeSchema", "true").parquet(case["folder"])
        traces.createOrReplaceTempView("stored")
        text = columns(case, set(traces.columns), "spark", "`")
        spark.sql(f"SELECT {text} FROM stored").createOrReplaceTempView("steps")

    return view, lambda statement: [list(row) for row in spark.sql(statement).collect()]


def columns(case, there, engine, quote):
    kinds = KINDS[engine]
    typed = {name: f"CAST({quote}{name}{quote} AS {kinds[kind]})" for name, kind in case["columns"].items() if name in there}
    absent = {name: f"CAST(NULL AS {kinds[kind]})" for name, kind in case["columns"].items() if name not in there}
    return ", ".join(f"{value} AS {quote}{name}{quote}" for name, value in {**typed, **absent}.items())


def main():
    engine, request = sys.argv[1:]
    view, run = {"duckdb": duckdb_runner, "spark": spark_runner}[engine]()
    answers = []
    with open(request, encoding="utf-8") as file:
        for case in json.load(file):
            view(case)
            answers.append([])
            for statement in case["statements"]:
                try:
                    answers[-1].append(run(statement))
                except Exception as error:  # Whatever the engine gives is an answer.
                    answers[-1].append(str(error))
    json.dump(answers, sys.stdout)


if __name__ == "__main__":
    main()
