"""Anthropic's Messages: limits as dates, overload as 529, no temperature from Claude Sonnet 5 on, cached tokens apart.

https://platform.claude.com/docs/en/api/rate-limits, .../api/errors, .../build-with-claude/prompt-caching
"""

from datetime import datetime, timedelta, timezone

from loopback import reply, serve

JSON = {"content-type": "application/json"}


def error(kind, message):
    return {"type": "error", "error": {"type": kind, "message": message}}


def message(body, text):
    if "haiku" not in body["model"] and "temperature" in body:
        return 400, JSON, error("invalid_request_error", "`temperature` is deprecated for this model.")
    usage = {"input_tokens": 600, "cache_read_input_tokens": 400, "cache_creation_input_tokens": 0, "output_tokens": 100}
    content = [{"type": "thinking", "thinking": "", "signature": "x"}, {"type": "text", "text": reply(text)}]
    said = {"type": "message", "role": "assistant", "model": body["model"], "content": content, "usage": usage}
    return 200, JSON, {**said, "stop_reason": "end_turn"}


def answer(at, path, headers, body, text):
    if headers.get("anthropic-version") is None:
        return 400, JSON, error("invalid_request_error", "anthropic-version: header is required")
    if at % 11 == 0:
        return 529, JSON, error("overloaded_error", "Overloaded")
    if at % 19 == 0:
        return 429, {**JSON, "retry-after": "0.05"}, error("rate_limit_error", "Number of requests has exceeded your limit")
    reset = datetime.now(timezone.utc) + timedelta(milliseconds=30)
    left = {"anthropic-ratelimit-requests-remaining": str(at % 7), "anthropic-ratelimit-requests-reset": reset.isoformat()}
    status, own, said = message(body, text)
    return status, {**own, **left}, said


serve(answer)
