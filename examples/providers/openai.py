"""OpenAI's chat completions: limits in headers, a dated snapshot answers, newer models take no temperature; batches of files.

https://platform.openai.com/docs/guides/rate-limits, .../guides/prompt-caching, .../guides/flex-processing, .../guides/batch,
.../api-reference/chat
"""

import json

from loopback import count, lock, reply, serve

JSON = {"content-type": "application/json"}
files, batches = {}, {}


def refuse(message, param):
    error = {"message": message, "type": "invalid_request_error", "param": param, "code": "unsupported_value"}
    return 400, JSON, {"error": error}


def result(at, request, endpoint):
    """A line of the output, or of the errors: some requests of a batch are refused, or expire, and are not billed."""
    assert (request["method"], request["url"]) == ("POST", endpoint)
    body, response, error = request["body"], None, None
    status, _, said = completion(1, body, json.dumps(body))
    if at % 14 == 3:
        status, said = 429, {"error": {"message": "Rate limit reached", "type": "requests", "code": "rate_limit_exceeded"}}
    if at % 14 == 10:
        error = {"code": "batch_expired", "message": "This request could not be executed before the completion window expired."}
    else:
        response = {"status_code": status, "request_id": f"req_{at}", "body": said}
    with lock:
        count["paid"] += response is not None and status == 200
    line = {"id": f"batch_req_{at}", "custom_id": request["custom_id"], "response": response, "error": error}
    return json.dumps(line), response is not None and status == 200


def create(at, body):
    """The third batch fails when its file is looked at: the account has too many tokens under way."""
    name = f"batch_{at}"
    if len(batches) == 2:
        fault = {"code": "token_limit_exceeded", "message": "Enqueued token limit reached for gpt-5.1.", "param": None, "line": None}
        batches[name] = {"status": "failed", "errors": {"object": "list", "data": [fault]}}
    else:
        requests = [json.loads(line) for line in files[body["input_file_id"]].splitlines()]
        known = sum(state.get("count", 0) for state in batches.values())
        lines = [result(known + number, request, body["endpoint"]) for number, request in enumerate(requests)]
        batches[name] = {"status": "completed", "count": len(lines), "output_file_id": None, "error_file_id": None}
        for key, wanted in (("output_file_id", True), ("error_file_id", False)):
            some = [line for line, is_whole in reversed(lines) if is_whole == wanted]
            if some:
                batches[name][key] = f"file-{key}-{at}"
                files[f"file-{key}-{at}"] = "\n".join(some) + "\n"
    assert body["completion_window"] == "24h"
    return 200, JSON, {"id": name, "object": "batch", "status": "validating"}


def batch(at, path, headers, body, text):
    if path.endswith("/files"):
        boundary = headers["content-type"].split("boundary=")[1]
        parts = [part.split("\r\n\r\n", 1) for part in text.split(f"--{boundary}")[1:-1]]
        fields = {head.split('name="')[1].split('"')[0]: held.removesuffix("\r\n") for head, held in parts}
        assert fields["purpose"] == "batch"
        files[f"file-{at}"] = fields["file"]
        return 200, JSON, {"id": f"file-{at}", "object": "file", "purpose": "batch"}
    if "/files/" in path:
        return 200, {"content-type": "application/octet-stream"}, files[path.split("/files/")[1].split("/")[0]]
    if body:
        return create(at, body)
    name = path.split("/batches/")[1]
    state = batches[name]
    # A batch under way has ended when it is asked for the second time.
    asked = state["asked"] = state.get("asked", 0) + 1
    return 200, JSON, {"id": name, "object": "batch", **(state if asked > 1 else {"status": "in_progress"})}


def answer(at, path, headers, body, text):
    if "/files" in path or "/batches" in path:
        return batch(at, path, headers, body, text)
    if at % 13 == 0:
        error = {"message": "Rate limit reached", "type": "requests", "param": None, "code": "rate_limit_exceeded"}
        return 429, {**JSON, "retry-after-ms": "40"}, {"error": error}
    if body.get("service_tier") == "flex" and at % 5 == 0:
        error = {"message": "Resource unavailable", "type": "resource_unavailable", "param": None, "code": "resource_unavailable"}
        return 429, JSON, {"error": error}
    return completion(at, body, text)


def completion(at, body, text):
    if "max_tokens" in body:
        return refuse("Unsupported parameter: 'max_tokens' is not supported. Use 'max_completion_tokens'.", "max_tokens")
    if not body["model"].startswith("gpt-5.1") and "temperature" in body:
        return refuse("Unsupported value: 'temperature' does not support 0.2 with this model.", "temperature")
    left = {"x-ratelimit-limit-requests": "60", "x-ratelimit-remaining-requests": str(at % 17), "x-ratelimit-reset-requests": "30ms"}
    usage = {"prompt_tokens": 1000, "completion_tokens": 100, "prompt_tokens_details": {"cached_tokens": 400}}
    choice = {"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": reply(text)}}
    said = {"object": "chat.completion", "model": body["model"] + "-2026-09-29", "choices": [choice], "usage": usage}
    said["service_tier"] = body.get("service_tier", "default")
    return 200, {**JSON, **left}, said


serve(answer)
