"""A log of Inspect with many samples, each as its mock model makes it: `FILE`, `SAMPLES`."""

import json
import subprocess
import sys
import tempfile
from pathlib import Path
from zipfile import ZIP_DEFLATED, ZipFile

file, count = Path(sys.argv[1]), int(sys.argv[2])
maker = Path(__file__).parent.parent.parent / "tests/harness/logs/inspect_logs.py"
with tempfile.TemporaryDirectory() as folder:
    subprocess.run([sys.executable, maker, folder], check=True)
    with ZipFile(Path(folder) / "deflated.eval") as source:
        header, sample = source.read("header.json"), json.loads(source.read("samples/sky_epoch_1.json"))
header = json.loads(header)
header["eval"]["dataset"].update(samples=count, sample_ids=list(range(1, count + 1)))
with ZipFile(file, "w", ZIP_DEFLATED, compresslevel=1) as target:
    for number in range(1, count + 1):
        sample.update(id=number, epoch=1, uuid=f"sample-{number}")
        target.writestr(f"samples/{number}_epoch_1.json", json.dumps(sample))
    target.writestr("header.json", json.dumps(header))
