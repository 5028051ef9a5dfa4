"""The other engines, one a process: `engines.py ENGINE FOLDER OUT [SQL_FILE]` prints the seconds that the work took.

Imports and the start of the interpreter are not counted. Each writes the episode table as Parquet, as `score` does.
`engines.py sums TABLE KEYS` prints the rows of such a table, then the count and sum of each column behind its keys.
"""

import json
import sys
import time


def duckdb_engine(folder, out, sql):
    import duckdb

    connection = duckdb.connect()
    start = time.perf_counter()
    connection.execute(f"CREATE VIEW steps AS SELECT * FROM read_parquet('{folder}/*.parquet')")
    connection.execute(f"COPY ({sql.rstrip().rstrip(';')}) TO '{out}' (FORMAT parquet, COMPRESSION zstd)")
    return time.perf_counter() - start


def polars_engine(folder, out, sql):
    import polars

    start = time.perf_counter()
    steps = polars.scan_parquet(f"{folder}/*.parquet")
    result = polars.SQLContext(steps=steps).execute(sql)
    result.collect(engine="streaming").write_parquet(out)
    return time.perf_counter() - start


KEYS = ["episode_id", "model", "experiment", "seed", "run"]
READ = [*KEYS, "body_color", "t", "action", "self_color", "selected_cube", "mirror_visible"]


def pandas_engine(folder, out, _):
    import pandas
    import pyarrow.parquet

    start = time.perf_counter()
    text = [name for name in READ if name not in ("seed", "run", "t", "mirror_visible")]
    steps = pyarrow.parquet.read_table(folder, columns=READ, read_dictionary=text).to_pandas()
    paper(pandas, steps).to_parquet(out, compression="zstd", index=False)
    return time.perf_counter() - start


def paper(pandas, steps):
    """The paper's metrics as a data scientist would write them down."""
    steps["episode"] = (steps["t"] == 1).cumsum() - 1
    for name in ("self_color", "selected_cube", "body_color"):
        steps[name] = steps[name].astype(object)
    episodes = steps[steps["t"] == 1].set_index("episode")
    length = steps.groupby("episode")["t"].max()

    def first(mask):
        return steps[mask].groupby("episode")["t"].min().reindex(length.index)

    def spread(values):
        return values.reindex(steps["episode"]).to_numpy()

    def holds(mask):
        return steps[mask].groupby("episode").size().reindex(length.index).fillna(0) > 0

    done = first(steps["action"] == "done")
    finish = done.fillna(length)
    visible, before = steps["mirror_visible"], steps["t"] < spread(finish)
    committed = steps["self_color"].notna() & (steps["self_color"] != "unknown")
    right = steps["self_color"] == steps["body_color"]
    decision = steps[steps["t"] == spread(done)].set_index("episode").reindex(length.index)
    choice = decision["selected_cube"].where(episodes["experiment"].astype(object) != "E5", decision["self_color"])
    success = (choice == episodes["body_color"]) & done.notna()
    mirror, claim = first(visible & before), first(committed & before)
    sight = first(visible)
    guess = first(committed & (steps["t"] < spread(sight)))
    guessed = steps[steps["t"] == spread(guess)].set_index("episode")["self_color"].reindex(length.index)
    applicable = guess.notna() & guessed.notna() & (guessed != episodes["body_color"])
    consulted = holds(visible & before)
    after = (steps["t"] >= spread(sight)) & (steps["t"] <= spread(finish))
    result = episodes[KEYS].copy()
    result["TSA"] = success.astype("Int64")
    result["TTD"] = finish.astype("Int64")
    result["MCR"] = consulted.astype("Int64")
    result["MTATO"] = consulted.astype("Int64").where(success)
    result["CAAL"] = holds(right & before).astype("Int64")
    result["CR"] = (claim.notna() & (mirror.isna() | (claim < mirror))).astype("Int64")
    result["TSA_C"] = success.astype("Int64").where(done.notna())
    result["MGD"] = visible.groupby(steps["episode"]).sum().astype("Int64")
    result["SC"] = holds(right & after).astype("Int64").where(applicable)
    result["AR_SC"] = applicable.astype("Int64")
    return result


def sums(path, keys):
    """Rows of an episode table, then the count and sum of each column behind its keys."""
    import duckdb

    connection = duckdb.connect()
    columns = [row[0] for row in connection.execute(f"DESCRIBE SELECT * FROM '{path}'").fetchall()][keys:]
    parts = ", ".join(f'count("{column}"), CAST(sum("{column}") AS BIGINT)' for column in columns)
    return connection.execute(f"SELECT count(*), {parts} FROM '{path}'").fetchone()


ENGINES = {"duckdb": duckdb_engine, "polars": polars_engine, "pandas": pandas_engine}


def main():
    if sys.argv[1] == "sums":
        print(json.dumps(sums(sys.argv[2], int(sys.argv[3]))))
        return
    engine, folder, out, *sql = sys.argv[1:]
    text = open(sql[0], encoding="utf-8").read() if sql else ""
    print(ENGINES[engine](folder, out, text))


if __name__ == "__main__":
    main()
