"""An agent that walks for as long as it may and keeps the frames that it sees: `walker.py --frames=FOLDER`, played with
`record --agent exec:'...'`. One action in three is a step ahead, so that frames differ."""

import json
import pathlib
import shutil
import sys

folder = pathlib.Path(sys.argv[1].split("=", 1)[1])
step = 0
for line in sys.stdin:
    message = json.loads(line)
    if message["kind"] != "observation":
        continue
    step += 1
    shutil.copy(message["image"]["path"], folder / f"{step:03}.png")
    reply = {
        "view-description": "a room",
        "reasoning": "I look around before I decide. " * 10,
        "action": "awd"[step % 3] if step % 11 else "a",
        "summary": f"step {step}",
        "selected_cube": "none",
        "identification": "unknown",
    }
    print(json.dumps(reply), flush=True)
