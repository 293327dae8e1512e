#!/bin/sh
# Print the path of an interpreter of the wanted Python version that can make virtual environments.
# usage: find_python.sh 3.11|3.13 [COMMAND]      with COMMAND only that one is tried
# Looked at, in this order: python3.X and python3 on the PATH, pyenv's versions, those that uv keeps. What was found
# and refused is said on standard error; exit code 1 if none is left.
set -eu

wanted=${1:?usage: find_python.sh 3.11|3.13 [COMMAND]}
refused=""
tried="|"

# What an environment needs: the right version with its lock (bpy has no free-threaded wheels), 64 bits, pip within
# reach (Debian keeps ensurepip in python3.X-venv) and the modules that a Python built by hand may lack.
probe='
import importlib, struct, sys, sysconfig
version = "%d.%d" % sys.version_info[:2]
if version != sys.argv[1]:
    sys.exit("WRONG")
if sysconfig.get_config_var("Py_GIL_DISABLED") or struct.calcsize("P") != 8:
    sys.exit("is not an ordinary 64-bit build")
for name in ("ctypes", "ssl", "zlib"):
    try:
        importlib.import_module(name)
    except ImportError:
        sys.exit("was built without the module " + name)
for name in ("venv", "ensurepip"):
    try:
        importlib.import_module(name)
    except ImportError:
        sys.exit("cannot make environments: apt install python%s-venv" % version)
print(sys.executable)
'

try() { # prints the interpreter and succeeds, or notes why not
    file=$(readlink -f "$(command -v "$1" 2>/dev/null)" 2>/dev/null) || return 1
    case $tried in *"|$file|"*) return 1 ;; esac # python3 is often python3.X again
    tried="$tried$file|"
    if answer=$("$1" -I -c "$probe" "$wanted" 2>&1); then
        echo "$answer"
        return 0
    fi
    case $answer in
        *WRONG) ;; # another version: nothing to say
        *) refused="$refused
  $1: $(echo "$answer" | tail -n 1)" ;;
    esac
    return 1
}

candidates() {
    echo "python$wanted"
    which -a "python$wanted" 2>/dev/null || true # the first on the PATH may be the one without venv
    echo python3
    echo python
    pyenv_root=${PYENV_ROOT:-$(pyenv root 2>/dev/null || echo "${HOME:-}/.pyenv")}
    ls -d "$pyenv_root/versions/$wanted".*/bin/python3 2>/dev/null || true
    uv_root=${UV_PYTHON_INSTALL_DIR:-$(uv python dir 2>/dev/null || echo "${HOME:-}/.local/share/uv/python")}
    ls -d "$uv_root/cpython-$wanted".*/bin/python3 2>/dev/null || true
}

list=$(mktemp)
trap 'rm -f "$list"' EXIT
if [ -n "${2:-}" ]; then echo "$2" >"$list"; else candidates >"$list"; fi
while IFS= read -r candidate; do
    if try "$candidate"; then exit 0; fi
done <"$list"

[ -z "$refused" ] || echo "Python $wanted was found but cannot be used:$refused" >&2
exit 1
