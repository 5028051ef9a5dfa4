#!/bin/sh
# Programs whose logs `import` reads.
exec "$(dirname "$0")/get-packages.sh" python-harnesses inspect_ai==0.3.285 inspect-robots==0.60.0
