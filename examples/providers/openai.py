"""OpenAI's chat completions: limits in headers, a dated snapshot answers, newer models take no temperature.

https://platform.openai.com/docs/guides/rate-limits, .../guides/prompt-caching, .../guides/flex-processing,
.../api-reference/chat
"""

from loopback import reply, serve

JSON = {"content-type": "application/json"}


def refuse(message, param):
    error = {"message": message, "type": "invalid_request_error", "param": param, "code": "unsupported_value"}
    return 400, JSON, {"error": error}


def answer(at, path, headers, body, text):
    if at % 13 == 0:
        error = {"message": "Rate limit reached", "type": "requests", "param": None, "code": "rate_limit_exceeded"}
        return 429, {**JSON, "retry-after-ms": "40"}, {"error": error}
    if body.get("service_tier") == "flex" and at % 5 == 0:
        error = {"message": "Resource unavailable", "type": "resource_unavailable", "param": None, "code": "resource_unavailable"}
        return 429, JSON, {"error": error}
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
