#!/bin/sh
# Prints the folder that PYTHONPATH needs for NumPy, with which the agents that see are written.
exec "$(dirname "$0")/get-packages.sh" python-numpy numpy==2.4.6
