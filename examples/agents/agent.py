"""A program that plays: mirrorstats record --agent exec:'python3 examples/agents/agent.py'

One process plays one episode. Each line on standard input is a message; each observation is answered by one line on
standard output, and everything else that there is to say goes to standard error.
"""
import json
import sys


def decide(task, seen):
    """Walks about, turning away from walls. A model would be given seen["image"]["path"] and seen["user_prompt"]."""
    action = "a" if seen["wall_warning"] or seen["t"] % 5 == 0 else "w"
    reply = {
        "view-description": "not looked at",
        "reasoning": "turn away from walls",
        "action": action,
        "summary": f"step {seen['t']} of {task['max_steps']}",
        "identification": "unknown",
    }
    return reply if task["family"] == "exploration" else {**reply, "selected_cube": "none"}


for line in sys.stdin:
    message = json.loads(line)
    if message["kind"] == "task":
        task = message
    elif message["kind"] == "observation":
        print(json.dumps(decide(task, message)), flush=True)
    elif message["kind"] == "end":
        break
