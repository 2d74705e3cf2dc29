#!/usr/bin/env python3
"""Turns the built server manifests into what `podman play kube` 4.3 understands.

usage: play.py IMAGE SECRETS <built.yaml >play.yaml

A StatefulSet becomes a Deployment with a PersistentVolumeClaim, Secrets become ConfigMaps made from the folder that
docker/secrets.sh wrote, and what podman does not know (network policies, budgets, namespaces, services) is left out.
Security contexts, limits, probes, mounts and environment stay as they are: they are what is tried.
"""

import copy
import pathlib
import sys

import check


def config_map(name, files):
    """A ConfigMap with the text of these files."""
    data = {key: path.read_text() for key, path in files.items()}
    return {"apiVersion": "v1", "kind": "ConfigMap", "metadata": {"name": name}, "data": data}


def secrets(folder):
    """What README.md lets one create in a cluster, under the same names and keys."""
    cert, key = folder / "tls" / "cert.pem", folder / "tls" / "key.pem"
    return [
        config_map("karst-tls", {"tls.crt": cert, "tls.key": key}),
        config_map("karst-ca", {"ca.crt": cert}),
        config_map("karst-tokens", {"tokens": folder / "tokens"}),
    ]


def plain_volume(volume):
    """A volume without secrets."""
    if "secret" in volume:
        return {"name": volume["name"], "configMap": {"name": volume["secret"]["secretName"]}}
    return volume


def claims(server):
    """A claim of its own for each template of a StatefulSet."""
    for template in server["spec"].get("volumeClaimTemplates", []):
        name = f"{server['metadata']['name']}-{template['metadata']['name']}"
        yield {
            "apiVersion": "v1",
            "kind": "PersistentVolumeClaim",
            "metadata": {"name": name},
            "spec": copy.deepcopy(template["spec"]),
        }


def deployment(server, image):
    """The StatefulSet as a Deployment."""
    template = copy.deepcopy(server["spec"]["template"])
    spec = template["spec"]
    spec["volumes"] = [plain_volume(volume) for volume in spec.get("volumes", [])]
    for claim in server["spec"].get("volumeClaimTemplates", []):
        name = claim["metadata"]["name"]
        reference = {"claimName": f"{server['metadata']['name']}-{name}"}
        spec["volumes"].append({"name": name, "persistentVolumeClaim": reference})
    for container in spec["containers"]:
        container["image"] = image
    return {
        "apiVersion": "apps/v1",
        "kind": "Deployment",
        "metadata": {"name": server["metadata"]["name"]},
        "spec": {"replicas": 1, "selector": server["spec"]["selector"], "template": template},
    }


def convert(docs, image, folder):
    """Every document that podman gets, what is referred to first."""
    yield from secrets(folder)
    yield from check.kinds(docs, "ConfigMap")
    for server in check.kinds(docs, "StatefulSet"):
        yield from claims(server)
        yield deployment(server, image)


def main():
    """Reads the built manifests, writes what podman plays."""
    if len(sys.argv) != 3:
        sys.exit(__doc__)
    import yaml

    docs = [doc for doc in yaml.safe_load_all(sys.stdin) if doc]
    yaml.safe_dump_all(convert(docs, sys.argv[1], pathlib.Path(sys.argv[2])), sys.stdout)


if __name__ == "__main__":
    main()
