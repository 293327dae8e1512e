#!/bin/sh
# Make or bring up to date one environment, of the first Python that fits, and print the path of its interpreter.
# usage: any_env.sh EXTRAS      PYTHON=COMMAND in the environment: that interpreter
set -eu

extras=${1:?usage: any_env.sh EXTRAS}
cd "$(dirname "$0")"

for version in 3.11 3.13; do
    if sh find_python.sh "$version" "${PYTHON:-}" >/dev/null; then
        exec sh setup_env.sh "$version" "$extras" "${PYTHON:-}"
    fi
done

if [ -n "${PYTHON:-}" ]; then
    echo "PYTHON=$PYTHON is not a Python 3.11 or 3.13 that can make environments." >&2
else
    echo "No usable Python 3.11 or 3.13. Debian 12: apt install python3 python3-venv (3.11); Debian 13: the same (3.13)." >&2
fi
exit 1
