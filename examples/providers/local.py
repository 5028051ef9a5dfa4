"""A server of one's own, such as llama.cpp, vLLM or Ollama: no key, a file's name as the model, no schema, no prices.

https://github.com/ggml-org/llama.cpp/tree/master/tools/server, https://docs.vllm.ai/en/latest/serving/openai_compatible_server
"""

import json

from loopback import reply, serve


def answer(at, path, headers, body, text):
    if at == 1:
        # llama.cpp, while it loads the model.
        error = {"code": 503, "message": "Loading model", "type": "unavailable_error"}
        return 503, {"content-type": "application/json; charset=utf-8"}, {"error": error}
    # A schema in the request means nothing to it.
    words = reply(json.dumps(body["messages"]))
    # A small model: thoughts, a fence, an action in another spelling, a comment, a raw line feed.
    words = [
        words,
        f"<think>where am I?</think>\n{words}",
        f"```json\n{words}\n```",
        words.replace('"action": "a"', '"action": "A"'),
        words.replace('"action"', '// turn\n"action"'),
        words.replace("a wall", "a wall,\nwhite"),
    ][at % 6]
    choice = {"index": 0, "finish_reason": "stop", "message": {"role": "assistant", "content": words}}
    usage = {"prompt_tokens": 1000, "completion_tokens": 100, "total_tokens": 1100}
    return 200, {"content-type": "text/plain"}, {"model": "/models/own-q4.gguf", "choices": [choice], "usage": usage}


serve(answer)
