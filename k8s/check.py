#!/usr/bin/env python3
"""Builds every overlay, holds it against Kubernetes' schemas and against the rules that karst's manifests keep.

usage: check.py [--install FOLDER] [OVERLAY...]

One line per finding; exit code 1 when there is one, else 0. Needs kubectl or kustomize, and the Python packages PyYAML
and kubernetes-validate; what is missing is one line `skipped: ...`. With --install the packages are put into a virtual
environment in FOLDER.
"""

import argparse
import os
import pathlib
import re
import shutil
import subprocess
import sys

HERE = pathlib.Path(__file__).resolve().parent
PACKAGES = ["PyYAML==6.0.3", "kubernetes-validate==1.37.0"]
# The oldest version whose features the manifests use (a Job's podFailurePolicy) and a new one.
SCHEMAS = ("1.31", "1.37")

# What whoever runs karst makes by hand (README.md): names that may be referred to without being in the build.
MADE_BY_HAND = {"ConfigMap": {"karst-ca"}, "Secret": {"karst-tls", "karst-tokens", "karst-worker-token"}}

WORKLOADS = ("Deployment", "StatefulSet", "DaemonSet", "Job")
SECRET_NAME = re.compile(r"TOKEN|SECRET|PASSWORD|PRIVATE|KEY", re.I)


def name_of(doc):
    """Kind and name, as messages show them."""
    return f"{doc.get('kind')}/{doc.get('metadata', {}).get('name')}"


def kinds(docs, *wanted):
    """The documents of these kinds."""
    return [doc for doc in docs if doc.get("kind") in wanted]


def pod(doc):
    """The pod template's spec of a workload."""
    return doc["spec"]["template"].get("spec", {})


def pod_labels(doc):
    """The labels that a workload gives its pods."""
    return doc["spec"]["template"].get("metadata", {}).get("labels", {})


def containers(docs):
    """(workload, container) for every container, init containers included."""
    for doc in kinds(docs, *WORKLOADS):
        for part in ("initContainers", "containers"):
            for container in pod(doc).get(part, []):
                yield doc, container


def selects(selector, labels):
    """Whether a label selector of equalities takes these labels; the empty one takes all."""
    if selector is None or selector.get("matchExpressions"):
        return False
    return all(labels.get(key) == value for key, value in selector.get("matchLabels", {}).items())


def container_rules(doc, container):
    """What is wrong with one container."""
    spec, own = pod(doc), container.get("securityContext", {})
    shared = spec.get("securityContext", {})
    resources = container.get("resources", {})
    for kind in ("requests", "limits"):
        for what in ("cpu", "memory"):
            if what not in resources.get(kind, {}):
                yield f"resources.{kind}.{what} is missing"
    if own.get("runAsNonRoot", shared.get("runAsNonRoot")) is not True:
        yield "runAsNonRoot is not true"
    if own.get("runAsUser", shared.get("runAsUser", 0)) == 0:
        yield "runAsUser is missing or 0"
    if own.get("readOnlyRootFilesystem") is not True:
        yield "readOnlyRootFilesystem is not true"
    if own.get("allowPrivilegeEscalation") is not False:
        yield "allowPrivilegeEscalation is not false"
    if own.get("privileged"):
        yield "privileged"
    if "ALL" not in own.get("capabilities", {}).get("drop", []):
        yield "capabilities.drop has not ALL"
    if own.get("capabilities", {}).get("add"):
        yield "capabilities.add is not empty"
    profile = own.get("seccompProfile", shared.get("seccompProfile", {})).get("type")
    if profile not in ("RuntimeDefault", "Localhost"):
        yield "seccompProfile.type is not RuntimeDefault"
    yield from image_rules(container.get("image", ""))


def image_rules(image):
    """An image is named by a digest or by a tag that is not `latest`."""
    name, _, digest = image.partition("@")
    _, _, tag = name.rpartition("/")[2].partition(":")
    if not digest and tag in ("", "latest"):
        yield f"image {image!r} has no tag or the tag latest"


def check_containers(docs):
    """Limits, users, file systems, capabilities, images."""
    for doc, container in containers(docs):
        for message in container_rules(doc, container):
            yield f"{name_of(doc)}: container {container.get('name')}: {message}"


def check_pods(docs):
    """Nothing of the node, no account of the cluster, no variables made from service names."""
    for doc in kinds(docs, *WORKLOADS):
        spec = pod(doc)
        for key in ("hostNetwork", "hostPID", "hostIPC"):
            if spec.get(key):
                yield f"{name_of(doc)}: {key}"
        for volume in spec.get("volumes", []):
            if "hostPath" in volume:
                yield f"{name_of(doc)}: volume {volume.get('name')}: hostPath"
        for key in ("automountServiceAccountToken", "enableServiceLinks"):
            if spec.get(key) is not False:
                yield f"{name_of(doc)}: {key} is not false"
        if "terminationGracePeriodSeconds" not in spec:
            yield f"{name_of(doc)}: terminationGracePeriodSeconds is missing"


def check_probes(docs):
    """Whatever has a port that others call has all three probes."""
    for doc, container in containers(docs):
        if container.get("ports"):
            for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
                if probe not in container:
                    yield f"{name_of(doc)}: container {container.get('name')}: {probe} is missing"


def check_network(docs):
    """Every pod is under a policy for what comes in and one for what goes out."""
    for doc in kinds(docs, *WORKLOADS):
        for direction in ("Ingress", "Egress"):
            policies = [
                policy
                for policy in kinds(docs, "NetworkPolicy")
                if direction in policy["spec"].get("policyTypes", [])
                and selects(policy["spec"].get("podSelector"), pod_labels(doc))
            ]
            if not policies:
                yield f"{name_of(doc)}: no NetworkPolicy for {direction} selects its pods"


def check_disruption(docs):
    """A server, which is the only one, has a PodDisruptionBudget."""
    for doc in kinds(docs, "StatefulSet"):
        budgets = kinds(docs, "PodDisruptionBudget")
        if not any(selects(budget["spec"].get("selector"), pod_labels(doc)) for budget in budgets):
            yield f"{name_of(doc)}: no PodDisruptionBudget selects its pods"


def check_secrets(docs):
    """Secrets are referred to and never written out."""
    for doc in kinds(docs, "Secret"):
        yield f"{name_of(doc)}: a secret is part of the build"
    for doc in kinds(docs, "ConfigMap"):
        for key, value in doc.get("data", {}).items():
            if "PRIVATE KEY" in value or (SECRET_NAME.search(key) and not value.startswith("/")):
                yield f"{name_of(doc)}: {key} looks like a secret; only paths of secrets belong here"
    for doc, container in containers(docs):
        for variable in container.get("env", []):
            value = variable.get("value", "")
            if SECRET_NAME.search(variable["name"]) and value and not value.startswith("/"):
                yield f"{name_of(doc)}: {variable['name']} is written out; refer to a secret"


def check_selectors(docs):
    """Workloads select their own pods; services, budgets, policies and scalers find what they are for."""
    workloads = kinds(docs, *WORKLOADS)
    for doc in workloads:
        if doc["kind"] != "Job" and not selects(doc["spec"].get("selector"), pod_labels(doc)):
            yield f"{name_of(doc)}: the selector does not match the labels of its pods"
    for doc in kinds(docs, "PodDisruptionBudget"):
        if not any(selects(doc["spec"].get("selector"), pod_labels(workload)) for workload in workloads):
            yield f"{name_of(doc)}: selects no pod"
    names = {name_of(doc) for doc in workloads}
    for doc in kinds(docs, "HorizontalPodAutoscaler"):
        target = doc["spec"]["scaleTargetRef"]
        if f"{target['kind']}/{target['name']}" not in names:
            yield f"{name_of(doc)}: scales {target['kind']}/{target['name']}, which is not there"


def check_services(docs):
    """A service selects pods that have the port it sends to."""
    for doc in kinds(docs, "Service"):
        selector = {"matchLabels": doc["spec"].get("selector", {})}
        found = [workload for workload in kinds(docs, *WORKLOADS) if selects(selector, pod_labels(workload))]
        if not doc["spec"].get("selector") or not found:
            yield f"{name_of(doc)}: selects no pod"
        for workload in found:
            open_ports = [port for one in pod(workload).get("containers", []) for port in one.get("ports", [])]
            for port in doc["spec"].get("ports", []):
                target = port.get("targetPort", port["port"])
                if not any(target in (other.get("name"), other["containerPort"]) for other in open_ports):
                    yield f"{name_of(doc)}: port {target} is not a port of {name_of(workload)}"


def references(spec):
    """(kind, name) of every ConfigMap and Secret that a pod refers to."""
    for volume in spec.get("volumes", []):
        if "configMap" in volume:
            yield "ConfigMap", volume["configMap"].get("name")
        if "secret" in volume:
            yield "Secret", volume["secret"].get("secretName")
    for container in spec.get("containers", []) + spec.get("initContainers", []):
        for source in container.get("envFrom", []):
            for key, kind in (("configMapRef", "ConfigMap"), ("secretRef", "Secret")):
                if key in source:
                    yield kind, source[key].get("name")


def check_references(docs):
    """What a pod refers to is in the build or made by hand; what it mounts is one of its volumes."""
    built = {(doc["kind"], doc["metadata"]["name"]) for doc in docs}
    for doc in kinds(docs, *WORKLOADS):
        for kind, name in references(pod(doc)):
            if (kind, name) not in built and name not in MADE_BY_HAND[kind]:
                yield f"{name_of(doc)}: refers to {kind}/{name}, which nobody makes"
        volumes = {volume["name"] for volume in pod(doc).get("volumes", [])}
        volumes |= {claim["metadata"]["name"] for claim in doc["spec"].get("volumeClaimTemplates", [])}
        for container in pod(doc).get("containers", []):
            for mount in container.get("volumeMounts", []):
                if mount["name"] not in volumes:
                    yield f"{name_of(doc)}: mounts {mount['name']}, which is not a volume of the pod"


def check_jobs(docs):
    """A job does not repeat what cannot succeed, and does not pay for what was taken away."""
    for doc in kinds(docs, "Job"):
        rules = doc["spec"].get("podFailurePolicy", {}).get("rules", [])
        failing = {
            code
            for rule in rules
            if rule["action"] == "FailJob"
            for code in rule.get("onExitCodes", {}).get("values", [])
        }
        if not {75, 77} <= failing:
            yield f"{name_of(doc)}: exit codes 75 and 77 do not fail the job"
        conditions = [
            condition.get("type")
            for rule in rules
            if rule["action"] == "Ignore"
            for condition in rule.get("onPodConditions", [])
        ]
        if "DisruptionTarget" not in conditions:
            yield f"{name_of(doc)}: a disruption costs a retry"


def check_grace(docs):
    """A worker has ended by itself before it is killed."""
    maps = {doc["metadata"]["name"]: doc.get("data", {}) for doc in kinds(docs, "ConfigMap")}
    for doc in kinds(docs, *WORKLOADS):
        for kind, name in references(pod(doc)):
            grace = maps.get(name, {}).get("KARST_GRACE") if kind == "ConfigMap" else None
            if grace and int(grace) >= pod(doc).get("terminationGracePeriodSeconds", 30):
                yield f"{name_of(doc)}: KARST_GRACE={grace} is not below terminationGracePeriodSeconds"


POLICIES = [
    check_containers,
    check_pods,
    check_probes,
    check_network,
    check_disruption,
    check_secrets,
    check_selectors,
    check_services,
    check_references,
    check_jobs,
    check_grace,
]


def findings(docs):
    """Everything that breaks a rule, in the order of the rules."""
    return [message for policy in POLICIES for message in policy(docs)]


def schema_findings(docs):
    """What Kubernetes' own schemas say."""
    import kubernetes_validate

    for doc in docs:
        for version in SCHEMAS:
            try:
                kubernetes_validate.validate(doc, version, strict=True)
            except kubernetes_validate.ValidationError as error:
                where = ".".join(str(part) for part in error.path)
                yield f"{name_of(doc)}: Kubernetes {version}: {where}: {error.message.splitlines()[0]}"


def skip(why):
    """Ends the check where it cannot be made."""
    print(f"skipped: the manifests: {why}")
    sys.exit(0)


def builder():
    """The command that builds a kustomization."""
    if shutil.which("kubectl"):
        return ["kubectl", "kustomize"]
    if shutil.which("kustomize"):
        return ["kustomize", "build"]
    return skip("neither kubectl nor kustomize is installed")


def have_packages():
    """Whether this Python can read and validate manifests."""
    try:
        import kubernetes_validate  # noqa: F401
        import yaml  # noqa: F401
    except ImportError:
        return False
    return True


def need_packages(folder):
    """Goes on in a Python that has the packages; makes one in `folder` where that was allowed."""
    if have_packages():
        return
    if folder is None:
        skip("PyYAML or kubernetes-validate is not installed (check.py --install FOLDER)")
    python = pathlib.Path(folder).resolve() / "venv" / "bin" / "python3"
    if os.environ.get("KARST_CHECK_VENV"):
        sys.exit(f"error: {python} still lacks {' or '.join(PACKAGES)}")
    # The pip of this Python fills the other one: a system may have no module for a second pip.
    pip = [sys.executable, "-m", "pip", "--python", python, "install", "--quiet", *PACKAGES]
    try:
        if not python.exists():
            subprocess.run([sys.executable, "-m", "venv", "--without-pip", python.parent.parent], check=True)
        if subprocess.run([python, "-c", "import yaml, kubernetes_validate"], capture_output=True, check=False).returncode:
            subprocess.run(pip, check=True)
    except subprocess.CalledProcessError as error:
        skip(f"{' and '.join(PACKAGES)} cannot be installed here: {error}")
    os.environ["KARST_CHECK_VENV"] = "1"
    os.execv(python, [str(python), *sys.argv])


def main():
    """Reads the command line, checks each overlay."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--install", metavar="FOLDER", help="put missing Python packages into FOLDER")
    parser.add_argument("overlay", nargs="*", help="folders to check; by default all of overlays/")
    options = parser.parse_args()
    build = builder()
    need_packages(options.install)
    import yaml

    overlays = options.overlay or sorted(path.parent for path in HERE.glob("overlays/*/kustomization.yaml"))
    count = 0
    for overlay in overlays:
        built = subprocess.run([*build, overlay], capture_output=True, text=True, check=False)
        if built.returncode != 0:
            found, docs = [built.stderr.strip()], []
        else:
            docs = [doc for doc in yaml.safe_load_all(built.stdout) if doc]
            found = [*schema_findings(docs), *findings(docs)]
        name = pathlib.Path(overlay).name
        for message in found:
            print(f"{name}: {message}")
        print(f"{name}: {len(docs)} objects, {len(found)} findings")
        count += len(found)
    return 1 if count else 0


if __name__ == "__main__":
    sys.exit(main())
