"""OpenRouter: what an answer cost, white space before the body, failures of a provider within HTTP 200, no endpoint.

https://openrouter.ai/docs/use-cases/usage-accounting, .../docs/features/provider-routing, .../docs/api-reference/errors
"""

import json

from loopback import reply, serve

JSON = {"content-type": "application/json"}


def answer(at, path, headers, body, text):
    if body.get("provider", {}).get("require_parameters") and "reasoning_effort" in body:
        message = "No endpoints found that can handle the requested parameters."
        return 404, JSON, {"error": {"code": 404, "message": message}}
    if at % 12 == 0:
        return 429, {**JSON, "retry-after": "0.05"}, {"error": {"code": 429, "message": "Provider returned error"}}
    name = body["model"].split(":")[0] + "-20260402"
    if at % 21 == 0:
        # The provider behind it broke off: half a text, beside an error.
        choice = {"finish_reason": "error", "error": {"code": 502, "message": "Upstream error"}, "message": {"content": "{"}}
        return 200, JSON, {"model": name, "provider": "a", "choices": [choice]}
    usage = {"prompt_tokens": 1000, "completion_tokens": 100, "cost": 0.0007, "prompt_tokens_details": {"cached_tokens": 0}}
    choice = {"finish_reason": "stop", "message": {"role": "assistant", "content": reply(text)}}
    said = json.dumps({"model": name, "provider": "a", "choices": [choice], "usage": usage})
    # Long requests are kept alive with white space, and some providers name no type of content.
    return 200, {} if at % 2 else JSON, "\n\n         \n" + said


serve(answer)
