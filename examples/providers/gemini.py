"""Google's generateContent: the delay of a limit in the body, overload as 503, old ids answered by newer models.

https://ai.google.dev/gemini-api/docs/rate-limits, .../docs/troubleshooting; google/rpc/error_details.proto
"""

from loopback import reply, serve

JSON = {"content-type": "application/json; charset=UTF-8"}
REROUTED = {"gemini-2.5-pro": "gemini-3.8-flash"}


def answer(at, path, headers, body, text):
    model = path.rsplit("/", 1)[1].split(":")[0]
    if at % 9 == 0:
        info = {"@type": "type.googleapis.com/google.rpc.RetryInfo", "retryDelay": "0.05s"}
        quota = {"quotaId": "GenerateRequestsPerMinutePerProjectPerModel"}
        failure = {"@type": "type.googleapis.com/google.rpc.QuotaFailure", "violations": [quota]}
        message = "You exceeded your current quota. Please retry in 50ms."
        error = {"code": 429, "status": "RESOURCE_EXHAUSTED", "message": message, "details": [failure, info]}
        return 429, JSON, {"error": error}
    if at % 23 == 0:
        message = "The model is overloaded. Please try again later."
        return 503, JSON, {"error": {"code": 503, "status": "UNAVAILABLE", "message": message}}
    usage = {"promptTokenCount": 1000, "cachedContentTokenCount": 400, "candidatesTokenCount": 60, "thoughtsTokenCount": 40}
    parts = [{"text": "hm", "thought": True}, {"text": reply(text)}]
    candidate = {"finishReason": "STOP", "content": {"role": "model", "parts": parts}}
    return 200, JSON, {"candidates": [candidate], "modelVersion": REROUTED.get(model, model), "usageMetadata": usage}


serve(answer)
