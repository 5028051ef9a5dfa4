"""The paper's ten metrics (assets/definitions/paper.toml) as one writes them by hand for DuckDB, Polars and pandas.

All write the table of `score`: one row per episode, ordered by experiment, model, seed, run and episode_id. No query
assumes more than the rules of a trace, with the exception that `PACKED` names. A benchmark compares every row with ours.
"""

KEYS = ["episode_id", "model", "experiment", "seed", "run"]
ORDER = ["experiment", "model", "seed", "run", "episode_id"]
METRICS = ["TSA", "TTD", "MCR", "MTATO", "CAAL", "CR", "TSA-C", "MGD", "SC", "AR_SC"]

# What a step says, before any grouping.
STEPS = """
    SELECT episode_id, model, experiment, seed, run, t, mirror_visible,
        action = 'done' AS is_done,
        self_color <> 'unknown' AS is_claim,
        self_color = body_color AS is_right,
        coalesce(CASE WHEN experiment = 'E5' THEN self_color ELSE selected_cube END = body_color, false) AS is_success
    FROM steps"""

CONSTANTS = "any_value(model) AS model, any_value(experiment) AS experiment, any_value(seed) AS seed, any_value(run) AS run"

# The general query: right for steps after `done`, too, because the window of SC is looked up in a list.
GENERAL = f"""
    SELECT *, coalesce(done, last) AS finish,
        coalesce(success_at_done, false) AS success,
        coalesce(claim < sight AND NOT claim_is_right, false) AS wrong_guess,
        coalesce(len(list_filter(rights, lambda t: t BETWEEN sight AND coalesce(done, last))) > 0, false) AS corrected
    FROM (
        SELECT episode_id, {CONSTANTS},
            max(t) AS last,
            min(t) FILTER (is_done) AS done,
            arg_min(is_success, t) FILTER (is_done) AS success_at_done,
            min(t) FILTER (mirror_visible) AS sight,
            sum(CAST(mirror_visible AS INTEGER)) AS visible,
            min(t) FILTER (is_claim) AS claim,
            arg_min(is_right, t) FILTER (is_claim) AS claim_is_right,
            min(t) FILTER (is_right) AS first_right,
            list(t) FILTER (is_right) AS rights
        FROM ({STEPS}) GROUP BY episode_id
    )"""

# The fastest query that was found. A timestep and a truth value share an integer, which is faster than arg_min. It
# takes for granted that no step follows `done`, which generated traces keep and the rules of a trace do not ask for.
PACKED = f"""
    SELECT *, decision // 2 AS done, coalesce(decision // 2, last) AS finish,
        coalesce(decision % 2 = 1, false) AS success,
        coalesce(commitment // 2 < sight AND commitment % 2 = 0, false) AS wrong_guess,
        commitment // 2 AS claim,
        coalesce(last_right >= sight, false) AS corrected
    FROM (
        SELECT episode_id, {CONSTANTS},
            max(t) AS last,
            min(CASE WHEN is_done THEN 2 * t + CAST(is_success AS INTEGER) END) AS decision,
            min(CASE WHEN mirror_visible THEN t END) AS sight,
            sum(CAST(mirror_visible AS INTEGER)) AS visible,
            min(CASE WHEN is_claim THEN 2 * t + CAST(is_right AS INTEGER) END) AS commitment,
            min(CASE WHEN is_right THEN t END) AS first_right,
            max(CASE WHEN is_right THEN t END) AS last_right
        FROM ({STEPS}) GROUP BY episode_id
    )"""

EPISODES = """
    SELECT episode_id, model, experiment, seed, run,
        CAST(success AS INTEGER) AS "TSA",
        finish AS "TTD",
        CAST(coalesce(sight < finish, false) AS INTEGER) AS "MCR",
        CASE WHEN success THEN CAST(coalesce(sight < finish, false) AS INTEGER) END AS "MTATO",
        CAST(coalesce(first_right < finish, false) AS INTEGER) AS "CAAL",
        CAST(coalesce(claim < finish AND (sight IS NULL OR claim < sight), false) AS INTEGER) AS "CR",
        CASE WHEN done IS NOT NULL THEN CAST(success AS INTEGER) END AS "TSA-C",
        CAST(visible AS INTEGER) AS "MGD",
        CASE WHEN wrong_guess THEN CAST(corrected AS INTEGER) END AS "SC",
        CAST(wrong_guess AS INTEGER) AS "AR_SC"
    FROM ({})"""


def duckdb_episodes(landmarks):
    """The episode table."""
    return f"{EPISODES.format(landmarks)} ORDER BY {', '.join(ORDER)}"


def duckdb_cells(landmarks):
    """The moments of every cell: experiment, model, metric, n, sum, sum_sq."""

    def moments(metric):
        # A sum is 128 bits wide, which Parquet does not have.
        total, squares = (f"CAST(coalesce(sum({x}), 0) AS BIGINT)" for x in (f'"{metric}"', f'"{metric}" * "{metric}"'))
        return f"""{{metric: '{metric}', n: count("{metric}"), sum: {total}, sum_sq: {squares}}}"""

    listed = ", ".join(moments(metric) for metric in METRICS)
    rows = f"""
        SELECT experiment, model, unnest([{listed}]) AS cell
        FROM ({EPISODES.format(landmarks)}) GROUP BY experiment, model"""
    return f"SELECT experiment, model, cell.metric, cell.n, cell.sum, cell.sum_sq FROM ({rows}) ORDER BY ALL"


def polars_episodes(steps):
    """The same as `PACKED`, as a lazy frame of Polars."""
    import polars as pl
    from polars import col

    def flag(condition):
        return condition.fill_null(False).cast(pl.Int32)

    def step(condition):
        return pl.when(condition).then(col("t"))

    def packed(condition, truth):
        return pl.when(condition).then(2 * col("t") + flag(truth)).min()

    right = col("self_color") == col("body_color")
    choice = pl.when(col("experiment") == "E5").then("self_color").otherwise("selected_cube")
    landmarks = steps.group_by("episode_id").agg(
        col("model", "experiment", "seed", "run").first(),
        last=col("t").max(),
        decision=packed(col("action") == "done", choice == col("body_color")),
        sight=step(col("mirror_visible")).min(),
        MGD=col("mirror_visible").sum(),
        commitment=packed(col("self_color") != "unknown", right),
        first_right=step(right).min(),
        last_right=step(right).max(),
    )
    derived = landmarks.with_columns(
        finish=pl.coalesce(col("decision") // 2, "last"),
        success=flag(col("decision") % 2 == 1),
        claim=col("commitment") // 2,
    ).with_columns(
        consulted=flag(col("sight") < col("finish")),
        wrong_guess=flag((col("claim") < col("sight")) & (col("commitment") % 2 == 0)),
    )
    unseen = col("sight").is_null() | (col("claim") < col("sight"))
    metrics = {
        "TSA": col("success"),
        "TTD": col("finish"),
        "MCR": col("consulted"),
        "MTATO": pl.when(col("success") == 1).then("consulted"),
        "CAAL": flag(col("first_right") < col("finish")),
        "CR": flag((col("claim") < col("finish")) & unseen),
        "TSA-C": pl.when(col("decision").is_not_null()).then("success"),
        "MGD": col("MGD"),
        "SC": pl.when(col("wrong_guess") == 1).then(flag(col("last_right") >= col("sight"))),
        "AR_SC": col("wrong_guess"),
    }
    return derived.select(*KEYS, **metrics).sort(ORDER)


def pandas_episodes(steps):
    """The same as a data scientist writes it in pandas. `steps` has its texts as categories."""
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
    result = episodes[KEYS].astype({name: object for name in ("episode_id", "model", "experiment")})
    result["TSA"] = success.astype("Int64")
    result["TTD"] = finish.astype("Int64")
    result["MCR"] = consulted.astype("Int64")
    result["MTATO"] = consulted.astype("Int64").where(success)
    result["CAAL"] = holds(right & before).astype("Int64")
    result["CR"] = (claim.notna() & (mirror.isna() | (claim < mirror))).astype("Int64")
    result["TSA-C"] = success.astype("Int64").where(done.notna())
    result["MGD"] = visible.groupby(steps["episode"]).sum().astype("Int64")
    result["SC"] = holds(right & after).astype("Int64").where(applicable)
    result["AR_SC"] = applicable.astype("Int64")
    return result.sort_values(ORDER)
