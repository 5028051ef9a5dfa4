"""Sends the same request with the official client libraries and with `record --agent vlm`, and compares them as a server sees them.

Usage: check-clients.py MIRRORSTATS

A recorder on loopback takes both requests. What `record` sends must be in the library's request, field by field, and the
library must send nothing in the body that `record` leaves out. Of the headers, those that carry the key and the version of
the protocol are compared; the path is compared whole.
"""

import base64
import http.server
import json
import os
import subprocess
import sys
import tempfile
import threading

import anthropic
import google.genai
import openai

KEY = "sk-loopback-0123456789"
MODEL = "model-1"
MAX_OUTPUT_TOKENS = 321
EFFORT = "low"
TEMPERATURE = 0.2
WORLD = "eye.width = 64\neye.height_px = 48\neye.samples = 0\n"
MODELS = """
[backend.openai-loopback]
wire_format = "openai-chat"
key = "LOOPBACK_KEY"
[backend.compatible-loopback]
wire_format = "openai-compatible"
key = "LOOPBACK_KEY"
[backend.google-loopback]
wire_format = "gemini"
key = "LOOPBACK_KEY"
[backend.anthropic-loopback]
wire_format = "anthropic-messages"
key = "LOOPBACK_KEY"
"""


class Recorder(http.server.BaseHTTPRequestHandler):
    """Keeps each request and refuses it."""

    requests = []

    def do_POST(self):
        body = self.rfile.read(int(self.headers["content-length"]))
        headers = {name.lower(): value for name, value in self.headers.items()}
        self.requests.append((self.path, headers, json.loads(body)))
        answer = b'{"error": {"message": "recorded"}}'
        self.send_response(400)
        self.send_header("content-type", "application/json")
        self.send_header("content-length", str(len(answer)))
        self.end_headers()
        self.wfile.write(answer)

    def log_message(self, *_):
        pass


def last_request():
    if len(Recorder.requests) != 1:
        sys.exit(f"expected one request, the recorder has {len(Recorder.requests)}")
    return Recorder.requests.pop()


def recorded(program, address, backend):
    """The first request of an episode."""
    with tempfile.TemporaryDirectory() as folder:
        for name, text in (("small.toml", WORLD), ("models.toml", MODELS)):
            with open(os.path.join(folder, name), "w", encoding="utf-8") as file:
                file.write(text)
        command = [program, "record", "--agent", "vlm", "--model", MODEL, "--models", "models.toml"]
        command += ["--backend", backend, "--base-url", address, "--max-output-tokens", str(MAX_OUTPUT_TOKENS)]
        command += ["--reasoning-effort", EFFORT]
        command += ["--experiment", "E1", "--seeds", "1", "--runs", "1", "--config", "small.toml", "--no-log"]
        ended = subprocess.run(
            command, cwd=folder, env={**os.environ, "LOOPBACK_KEY": KEY}, capture_output=True, text=True, check=False
        )
        if ended.returncode != 2 or "recorded" not in ended.stderr:
            sys.exit(f"record ended with {ended.returncode}: {ended.stderr}")
    return last_request()


def refused(call):
    try:
        call()
    except (openai.BadRequestError, google.genai.errors.ClientError, anthropic.BadRequestError):
        return last_request()
    sys.exit("the recorder's refusal did not come through the library")


def by_openai(origin, body, limit):
    system, user = body["messages"]
    text, image = user["content"]
    schema = body["response_format"]["json_schema"]["schema"]
    client = openai.OpenAI(api_key=KEY, base_url=f"{origin}/v1", max_retries=0)
    return refused(
        lambda: client.chat.completions.create(
            model=MODEL,
            messages=[
                {"role": "system", "content": system["content"]},
                {
                    "role": "user",
                    "content": [
                        {"type": "text", "text": text["text"]},
                        {"type": "image_url", "image_url": {"url": image["image_url"]["url"]}},
                    ],
                },
            ],
            temperature=TEMPERATURE,
            reasoning_effort=EFFORT,
            response_format={
                "type": "json_schema",
                "json_schema": {"name": "reply", "strict": True, "schema": schema},
            },
            **{limit: MAX_OUTPUT_TOKENS},
        )
    )


def by_google(origin, body):
    types = google.genai.types
    text, image = body["contents"][0]["parts"]
    client = google.genai.Client(
        api_key=KEY, vertexai=False, http_options=types.HttpOptions(base_url=origin, api_version="v1")
    )
    png = base64.b64decode(image["inlineData"]["data"], validate=True)
    return refused(
        lambda: client.models.generate_content(
            model=MODEL,
            contents=[text["text"], types.Part.from_bytes(data=png, mime_type="image/png")],
            config=types.GenerateContentConfig(
                system_instruction=body["systemInstruction"]["parts"][0]["text"],
                temperature=TEMPERATURE,
                max_output_tokens=MAX_OUTPUT_TOKENS,
                thinking_config=types.ThinkingConfig(thinking_level=EFFORT),
                response_mime_type="application/json",
                response_json_schema=body["generationConfig"]["responseJsonSchema"],
            ),
        )
    )


def by_anthropic(origin, body):
    text, image = body["messages"][0]["content"]
    client = anthropic.Anthropic(api_key=KEY, base_url=origin, max_retries=0)
    return refused(
        lambda: client.messages.create(
            model=MODEL,
            max_tokens=MAX_OUTPUT_TOKENS,
            # A model that thinks takes no temperature.
            thinking={"type": "adaptive"},
            system=body["system"],
            messages=[
                {
                    "role": "user",
                    "content": [
                        {"type": "text", "text": text["text"]},
                        {
                            "type": "image",
                            "source": {"type": "base64", "media_type": "image/png", "data": image["source"]["data"]},
                        },
                    ],
                }
            ],
            output_config={
                "effort": EFFORT,
                "format": {"type": "json_schema", "schema": body["output_config"]["format"]["schema"]},
            },
        )
    )


def differences(own, library, place="body"):
    """Every field in which two bodies differ."""
    if isinstance(own, dict) and isinstance(library, dict):
        for key in sorted(own.keys() | library.keys()):
            if key not in own or key not in library:
                yield f"{place}.{key} is only in {'record' if key in own else 'the library'}'s request"
            else:
                yield from differences(own[key], library[key], f"{place}.{key}")
    elif isinstance(own, list) and isinstance(library, list) and len(own) == len(library):
        for at, (left, right) in enumerate(zip(own, library)):
            yield from differences(left, right, f"{place}[{at}]")
    elif type(own) is not type(library) or own != library:
        yield f"{place} is {str(own)[:100]} in record's request and {str(library)[:100]} in the library's"


def as_protobuf(body):
    """The body as protobuf's JSON mapping reads it: a field has two spellings, and bytes come in either base64 alphabet.

    The Google API is documented as `mimeType` with plain base64; the library sends `mime_type` in the URL-safe alphabet.
    """
    if isinstance(body, list):
        return [as_protobuf(item) for item in body]
    if not isinstance(body, dict):
        return body
    read = {camel(key): as_protobuf(value) for key, value in body.items()}
    if isinstance(body.get("inlineData"), dict):
        data = read["inlineData"]["data"]
        read["inlineData"]["data"] = data.replace("-", "+").replace("_", "/")
    return read


def camel(name):
    first, *others = name.split("_")
    return first + "".join(word[:1].upper() + word[1:] for word in others)


def fields(body):
    if isinstance(body, dict):
        return sum(map(fields, body.values()))
    return sum(map(fields, body)) if isinstance(body, list) else 1


def compare(name, own, library, headers, read=lambda body: body):
    faults = list(differences(read(own[2]), read(library[2])))
    if own[0] != library[0]:
        faults.append(f"the path is {own[0]} in record's request and {library[0]} in the library's")
    for header in ("content-type", *headers):
        if own[1].get(header) is None or own[1].get(header) != library[1].get(header):
            faults.append(f"the header {header} is {own[1].get(header)}, and {library[1].get(header)} in the library's")
    if faults:
        sys.exit(f"{name}: record's request is not the library's\n  " + "\n  ".join(faults))
    print(f"{name}: {own[0]}, {fields(own[2])} fields, {len(headers) + 1} headers: the same")


def main():
    program = os.path.abspath(sys.argv[1])
    server = http.server.ThreadingHTTPServer(("127.0.0.1", 0), Recorder)
    threading.Thread(target=server.serve_forever, daemon=True).start()
    origin = f"http://127.0.0.1:{server.server_port}"

    for backend, limit in (("openai-loopback", "max_completion_tokens"), ("compatible-loopback", "max_tokens")):
        own = recorded(program, f"{origin}/v1", backend)
        compare(f"openai {openai.__version__}, {limit}", own, by_openai(origin, own[2], limit), ["authorization"])
    own = recorded(program, f"{origin}/v1", "google-loopback")
    library = by_google(origin, own[2])
    compare(f"google-genai {google.genai.__version__}", own, library, ["x-goog-api-key"], as_protobuf)
    own = recorded(program, f"{origin}/v1", "anthropic-loopback")
    versions = ["x-api-key", "anthropic-version"]
    compare(f"anthropic {anthropic.__version__}", own, by_anthropic(origin, own[2]), versions)


if __name__ == "__main__":
    main()
