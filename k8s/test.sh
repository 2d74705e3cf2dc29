#!/usr/bin/env bash
# Checks the manifests: first the checks themselves, then every overlay against Kubernetes' schemas and karst's rules.
set -euo pipefail

here="$(cd -- "$(dirname -- "${BASH_SOURCE[0]}")" && pwd)"
# A virtual environment for check.py: made where installing is allowed, used where it is.
tools="$(dirname -- "$here")/target/tools/k8s"

PYTHONDONTWRITEBYTECODE=1 python3 "$here/test_check.py" --quiet
if [ "${KARST_TEST_INSTALL:-}" = 1 ] || [ -x "$tools/venv/bin/python3" ]; then
  "$here/check.py" --install "$tools"
else
  "$here/check.py"
fi
