"""Anthropic's Messages: limits as dates, overload as 529, no temperature from Claude Sonnet 5 on, cached tokens apart; batches.

https://platform.claude.com/docs/en/api/rate-limits, .../api/errors, .../build-with-claude/prompt-caching, .../batch-processing
"""

import json
from datetime import datetime, timedelta, timezone

from loopback import count, lock, reply, serve

JSON = {"content-type": "application/json"}
batches = {}


def error(kind, message):
    return {"type": "error", "error": {"type": kind, "message": message}}


def message(body, text):
    if "haiku" not in body["model"] and "temperature" in body:
        return 400, JSON, error("invalid_request_error", "`temperature` is deprecated for this model.")
    usage = {"input_tokens": 600, "cache_read_input_tokens": 400, "cache_creation_input_tokens": 0, "output_tokens": 100}
    content = [{"type": "thinking", "thinking": "", "signature": "x"}, {"type": "text", "text": reply(text)}]
    said = {"type": "message", "role": "assistant", "model": body["model"], "content": content, "usage": usage}
    return 200, JSON, {**said, "stop_reason": "end_turn"}


def result(at, request):
    """A line of results: some requests of a batch end without an answer, and are not billed."""
    if at % 7 == 3:
        ended = {"type": "errored", "error": error("overloaded_error", "Overloaded")} if at % 2 else {"type": "expired"}
    else:
        status, _, said = message(request["params"], json.dumps(request["params"]))
        ended = {"type": "succeeded", "message": said} if status == 200 else {"type": "errored", "error": said}
    with lock:
        count["paid"] += ended["type"] == "succeeded"
    return json.dumps({"custom_id": request["custom_id"], "result": ended})


def batch(at, path, body):
    """A batch under way has ended when it is asked for the second time."""
    if body:
        known = sum(len(lines) for lines, _ in batches.values())
        lines = [result(known + number, request) for number, request in enumerate(body["requests"])]
        batches[f"msgbatch_{at}"] = [lines, 0]
        return 200, JSON, {"id": f"msgbatch_{at}", "type": "message_batch", "processing_status": "in_progress"}
    name = path.split("/batches/")[1].split("/")[0]
    if path.endswith("/results"):
        return 200, {"content-type": "application/x-jsonl"}, "\n".join(reversed(batches[name][0])) + "\n"
    batches[name][1] += 1
    return 200, JSON, {"id": name, "processing_status": "ended" if batches[name][1] > 1 else "in_progress"}


def answer(at, path, headers, body, text):
    if headers.get("anthropic-version") is None:
        return 400, JSON, error("invalid_request_error", "anthropic-version: header is required")
    if "/batches" in path:
        return batch(at, path, body)
    if at % 11 == 0:
        return 529, JSON, error("overloaded_error", "Overloaded")
    if at % 19 == 0:
        return 429, {**JSON, "retry-after": "0.05"}, error("rate_limit_error", "Number of requests has exceeded your limit")
    reset = datetime.now(timezone.utc) + timedelta(milliseconds=30)
    left = {"anthropic-ratelimit-requests-remaining": str(at % 7), "anthropic-ratelimit-requests-reset": reset.isoformat()}
    status, own, said = message(body, text)
    return status, {**own, **left}, said


serve(answer)
