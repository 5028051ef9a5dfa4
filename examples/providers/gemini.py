"""Google's generateContent: the delay of a limit in the body, overload as 503, old ids answered by newer models; batches.

https://ai.google.dev/gemini-api/docs/rate-limits, .../docs/troubleshooting, .../docs/batch-api; google/rpc/error_details.proto
"""

import json

from loopback import count, lock, reply, serve

JSON = {"content-type": "application/json; charset=UTF-8"}
REROUTED = {"gemini-2.5-pro": "gemini-3.8-flash"}
batches = {}


def result(at, model, request):
    """Some requests of a batch end in an error, with a code of google/rpc/code.proto, and are not billed."""
    if at % 7 == 3:
        return {"error": {"code": 8 if at % 2 else 14, "message": "Resource exhausted"}}
    with lock:
        count["paid"] += 1
    response = whole(model, json.dumps(request["request"]))[2]
    # Not every answer has the metadata of its request: the order says which one it belongs to.
    return {"response": response, **({"metadata": request["metadata"]} if at % 3 else {})}


def batch(at, path, body):
    """A batch under way has ended when it is asked for the second time."""
    if body:
        requests = body["batch"]["inputConfig"]["requests"]["requests"]
        assert body["batch"]["displayName"] and path.endswith(":batchGenerateContent")
        model, known = path.rsplit("/", 1)[1].split(":")[0], sum(len(made) for made, _ in batches.values())
        made = [result(known + number, model, request) for number, request in enumerate(requests)]
        batches[f"batches/{at}"] = [made, 0]
        return 200, JSON, {"name": f"batches/{at}", "metadata": {"state": "BATCH_STATE_PENDING"}}
    name = path.split("/v1beta/")[1]
    batches[name][1] += 1
    if batches[name][1] < 2:
        return 200, JSON, {"name": name, "metadata": {"state": "BATCH_STATE_RUNNING"}}
    output = {"inlinedResponses": {"inlinedResponses": batches[name][0]}}
    return 200, JSON, {"name": name, "done": True, "metadata": {"state": "BATCH_STATE_SUCCEEDED"}, "response": output}


def answer(at, path, headers, body, text):
    if ":batch" in path or "/batches/" in path:
        return batch(at, path, body)
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
    return whole(model, text)


def whole(model, text):
    usage = {"promptTokenCount": 1000, "cachedContentTokenCount": 400, "candidatesTokenCount": 60, "thoughtsTokenCount": 40}
    parts = [{"text": "hm", "thought": True}, {"text": reply(text)}]
    candidate = {"finishReason": "STOP", "content": {"role": "model", "parts": parts}}
    return 200, JSON, {"candidates": [candidate], "modelVersion": REROUTED.get(model, model), "usageMetadata": usage}


serve(answer)
