"""Runs one statement over traces on Spark; `mirrorstats score --engine spark` submits this file with a request.

The request (JSON, the one argument) names what to read, which columns and types, the statements, and where results
go. What happened is written as JSON to the request's `answer`: that file, not the exit code, is what is believed.
Nothing is printed. Only the driver needs Python; the executors run SQL alone.
"""

import json
import os
import shutil
import sys
import threading
import time
from multiprocessing.pool import ThreadPool
from urllib.parse import unquote, urlsplit

from pyspark.sql import SparkSession
from pyspark.sql import functions as F
from pyspark.sql import types as T

TYPES = {"string": T.StringType(), "int": T.LongType(), "float": T.DoubleType(), "bool": T.BooleanType()}
# What a file may hold where the request says the key.
ACCEPTED = {
    "string": (T.StringType, T.BinaryType),
    "int": (T.ByteType, T.ShortType, T.IntegerType, T.LongType),
    "float": (T.FloatType, T.DoubleType),
    "bool": (T.BooleanType,),
}
# The statement is written for these settings, and no row may be left out quietly, whatever a cluster's defaults are.
SETTINGS = {
    "spark.sql.ansi.enabled": "true",
    "spark.sql.caseSensitive": "true",
    "spark.sql.parser.escapedStringLiterals": "false",
    "spark.sql.parser.quotedRegexColumnNames": "false",
    "spark.sql.files.ignoreCorruptFiles": "false",
    "spark.sql.files.ignoreMissingFiles": "false",
    "spark.sql.sources.ignoreDataLocality": "false",
    "spark.sql.sources.partitionColumnTypeInference.enabled": "false",
}


class Refusal(Exception):
    """Something about the traces that mirrorstats says in its own words."""

    def __init__(self, **found):
        super().__init__(str(found))
        self.found = found


def main():
    with open(sys.argv[1], encoding="utf-8") as file:
        request = json.load(file)
    # It may hold secrets, and is needed no more.
    os.remove(sys.argv[1])
    threading.Thread(target=watch, args=(request,), daemon=True).start()
    try:
        spark = session(request)
        answer = score(spark, request)
        spark.stop()
    except Refusal as refusal:
        answer = {"refused": refusal.found}
    except Exception as error:  # Whatever Spark gives: its cause is the answer.
        answer = {"failed": cause(error)}
    reply(request, answer)


def reply(request, answer):
    """Writes the answer, whole or not at all."""
    partial = request["answer"] + ".partial"
    with open(partial, "w", encoding="utf-8") as file:
        json.dump(answer, file)
    os.replace(partial, request["answer"])


def watch(request):
    """Ends the driver, and Spark with it, when the program that asked is gone or the time is up."""
    waited, step = 0.0, 0.25
    while True:
        time.sleep(step)
        waited += step
        try:
            os.kill(request["parent"], 0)
        except ProcessLookupError:
            shutil.rmtree(os.path.dirname(request["answer"]), ignore_errors=True)
            os._exit(1)
        except PermissionError:
            pass
        if request["timeout"] is not None and waited >= request["timeout"]:
            reply(request, {"late": {}})
            os._exit(1)


def session(request):
    builder = SparkSession.builder.appName("mirrorstats")
    for key, value in request["settings"].items():
        builder = builder.config(key, value)
    spark = builder.getOrCreate()
    for key, value in SETTINGS.items():
        spark.conf.set(key, value)
    return spark


def score(spark, request):
    recursive = inspect(spark, request) if request["inspect"] else False
    load(spark, request, recursive).createOrReplaceTempView("steps")
    checked = spark.sql(request["check"]).collect()[0]
    if request["rows"] is not None and checked["steps"] != request["rows"]:
        raise Refusal(rows={"expected": request["rows"], "found": checked["steps"]})
    if checked["faults"] or not checked["episodes"]:
        fault = checked["fault"]
        found = None if fault is None else fault.asDict()
        raise Refusal(rule={"fault": found, "faults": checked["faults"]})
    table = typed(spark.sql(request["statement"]), request)
    if request["folder"] is None:
        episodes = collect(table, request)
    else:
        table.write.mode("errorifexists").parquet(request["folder"])
        written = spark.read.option("recursiveFileLookup", "true").schema(table.schema).parquet(literal(request["folder"]))
        episodes = written.count()
    return {"done": {"episodes": episodes, "steps": checked["steps"], "spark": spark.version}}


def load(spark, request, recursive):
    """The traces with the columns that the statements name, each in the widest type of its kind; absent ones are null."""
    steps = None
    for group in request["sources"]:
        fields = [T.StructField(name, TYPES[kind]) for name, kind in request["columns"] if name not in group["void"]]
        part = reader(spark, request, recursive).schema(T.StructType(fields)).parquet(*group["paths"])
        for name, kind in request["columns"]:
            if name in group["void"]:
                part = part.withColumn(name, F.lit(None).cast(TYPES[kind]))
        steps = part if steps is None else steps.unionByName(part)
    return steps


def reader(spark, request, recursive=False):
    made = spark.read.option("recursiveFileLookup", recursive)
    if request["inspect"]:
        # As in folders of this machine: other files are no traces.
        made = made.option("pathGlobFilter", "*.parquet")
    return made.option("ignoreCorruptFiles", False).option("ignoreMissingFiles", False)


def inspect(spark, request):
    """Looks into every file's footer: an absent column would read as null, and count as never recorded.

    Tells whether the files lie in folders that name no partition, which Spark would otherwise pass over.
    """
    [group] = request["sources"]

    def files(recursive, *paths):
        return reader(spark, request, recursive).schema("t BIGINT").parquet(*paths).inputFiles()

    for path in group["paths"]:
        if not files(True, path):
            raise Refusal(empty=path)
    every = files(True, *group["paths"])

    def look(file):
        path = unquote(file)
        folders = {part.split("=", 1)[0] for part in urlsplit(file).path.split("/")[:-1] if "=" in part}
        single = reader(spark, request).option("basePath", path.rsplit("/", 1)[0]).parquet(literal(path))
        return path, folders, {field.name: field.dataType for field in single.schema}

    with ThreadPool(8) as pool:
        for path, folders, found in pool.imap(look, sorted(every)):
            compare(path, folders, found, request["columns"], request["optional"])
    return set(every) != set(files(False, *group["paths"]))


def compare(path, folders, found, columns, optional):
    for name, kind in columns:
        if name in folders and name in found:
            raise Refusal(column={"file": path, "column": name, "expected": "one value", "found": "one in the file and one in the name of its folder"})
        if name not in folders and name not in found and name not in optional:
            raise Refusal(column={"file": path, "column": name, "expected": kind, "found": None})
        if name in found and not isinstance(found[name], ACCEPTED[kind]):
            raise Refusal(column={"file": path, "column": name, "expected": kind, "found": found[name].simpleString()})


def literal(path):
    """The path for a reader that expands globs."""
    return "".join("\\" + c if c in "\\*?[]{}" else c for c in path)


def typed(table, request):
    """The statement's columns under their names and in the types of a file of scores, which carry what defines them."""
    columns = []
    for position, ((name, kind), found) in enumerate(zip(request["results"], table.columns)):
        column = table["`" + found.replace("`", "``") + "`"].cast(kind)
        columns.append(column.alias(name, metadata=request["metadata"]) if position == 0 else column.alias(name))
    return table.select(*columns)


def collect(table, request):
    """A line per episode: its five keys, the list of its metrics, the list of its labels."""
    metrics = 5 + sum(kind in ("bigint", "double") for _, kind in request["results"])
    episodes = 0
    with open(request["table"], "w", encoding="utf-8") as file:
        for row in table.toLocalIterator():
            json.dump([*row[:5], list(row[5:metrics]), list(row[metrics:])], file)
            file.write("\n")
            episodes += 1
    return episodes


def cause(error):
    """The innermost message of what Spark raised, and its name where Spark has one for it."""
    java = getattr(error, "java_exception", None)
    while java is not None and java.getCause() is not None:
        java = java.getCause()
    if java is not None:
        return {"name": java.getClass().getSimpleName(), "message": java.getMessage() or java.toString()}
    origin = getattr(error, "_origin", None)
    while origin is not None and origin.getCause() is not None:
        origin = origin.getCause()
    message = str(error) if origin is None else origin.getMessage() or origin.toString()
    return {"name": type(error).__name__, "message": message}


if __name__ == "__main__":
    main()
