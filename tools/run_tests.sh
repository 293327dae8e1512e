#!/bin/sh
# The source checks once and the tests on both Blender LTS releases, as far as their Pythons are here.
# usage: run_tests.sh EXTRAS_OF_3.11 EXTRAS_OF_3.13 MARKERS [PYTEST_ARGUMENT...]
# PYTHON=COMMAND in the environment: that interpreter alone. TEST_WORKERS=N: processes side by side; 2 if not given.
set -eu

extras_311=${1:?}
extras_313=${2:?}
markers=${3:?}
shift 3
cd "$(dirname "$0")/.."
# The processes share the cores already; spinning threads of linear algebra would only slow each other down.
export OMP_NUM_THREADS=1 OPENBLAS_NUM_THREADS=1

versions="3.11 3.13"
if [ -n "${PYTHON:-}" ]; then
    versions=$("$PYTHON" -c 'import sys; print("%d.%d" % sys.version_info[:2])')
fi

passed=0
failed=0
linted=""
summary=""
note() { summary="$summary
  $1"; }

for version in $versions; do
    case $version in
        3.11) extras=$extras_311 blender="Blender 4.5 LTS" ;;
        3.13) extras=$extras_313 blender="Blender 5.2 LTS" ;;
        *)
            note "Python $version: not run, Blender as a package needs 3.11 or 3.13"
            continue
            ;;
    esac
    if ! sh tools/find_python.sh "$version" "${PYTHON:-}" >/dev/null; then
        note "Python $version ($blender): NOT RUN, no such Python found (see tools/find_python.sh)"
        continue
    fi
    echo "== Python $version, $blender"
    if ! python=$(sh tools/setup_env.sh "$version" "$extras" "${PYTHON:-}"); then
        note "Python $version ($blender): FAILED, the environment could not be made"
        failed=$((failed + 1))
        continue
    fi
    if [ -z "$linted" ]; then
        linted=yes
        if "$python" tools/lint.py; then note "lint: passed"; else
            note "lint: FAILED"
            failed=$((failed + 1))
        fi
    fi
    start=$(date +%s)
    status=0
    # Blender has processes of its own: once ifcopenshell has worked in one, Blender 5.2's OBJ exporter aborts there.
    for part in "tests/blender" "tests --ignore=tests/blender"; do
        code=0
        # Without a limit on restarts a worker that crashes can leave the others waiting for ever.
        # shellcheck disable=SC2086 # the part is meant to be split
        "$python" -m pytest -q -n "${TEST_WORKERS:-2}" --dist loadfile --max-worker-restart 0 -m "$markers" "$@" \
            $part || code=$?
        # 5: none of the part's tests has these markers
        if [ "$code" -ne 0 ] && [ "$code" -ne 5 ]; then status=$code; fi
    done
    seconds=$(($(date +%s) - start))
    if [ "$status" -eq 0 ]; then
        note "Python $version ($blender): tests passed, $seconds s"
        passed=$((passed + 1))
    else
        note "Python $version ($blender): tests FAILED (pytest's code $status), $seconds s"
        failed=$((failed + 1))
    fi
done

echo "== Summary$summary"
if [ "$failed" -gt 0 ]; then exit 1; fi
if [ "$passed" -eq 0 ]; then
    echo "Nothing was tested: install Python 3.11 (Debian 12: apt install python3 python3-venv) or 3.13." >&2
    exit 1
fi
