#!/usr/bin/env python3
"""Breaks each rule of check.py once, in a small set of manifests that keeps them all, and sees it found."""

import copy
import unittest

import check


def container(name):
    """A container that keeps every rule."""
    return {
        "name": name,
        "image": "karst:0.1.0",
        "resources": {"requests": {"cpu": "1", "memory": "1Gi"}, "limits": {"cpu": "1", "memory": "1Gi"}},
        "securityContext": {
            "allowPrivilegeEscalation": False,
            "readOnlyRootFilesystem": True,
            "capabilities": {"drop": ["ALL"]},
        },
        "volumeMounts": [{"name": "data", "mountPath": "/data"}],
    }


def workload(kind, role):
    """A workload of one container that keeps every rule."""
    spec = {
        "automountServiceAccountToken": False,
        "enableServiceLinks": False,
        "terminationGracePeriodSeconds": 60,
        "securityContext": {"runAsNonRoot": True, "runAsUser": 10001, "seccompProfile": {"type": "RuntimeDefault"}},
        "containers": [container(role)],
        "volumes": [{"name": "data", "secret": {"secretName": "karst-tls"}}],
    }
    labels = {"role": role}
    template = {"metadata": {"labels": dict(labels)}, "spec": spec}
    return {
        "kind": kind,
        "metadata": {"name": role},
        "spec": {"selector": {"matchLabels": labels}, "template": template},
    }


def good():
    """A server, a worker and what belongs to them, by name."""
    server, worker, job = workload("StatefulSet", "server"), workload("Deployment", "worker"), workload("Job", "job")
    del job["spec"]["selector"]
    job["spec"]["podFailurePolicy"] = {
        "rules": [
            {"action": "FailJob", "onExitCodes": {"values": [75, 77]}},
            {"action": "Ignore", "onPodConditions": [{"type": "DisruptionTarget"}]},
        ]
    }
    main = server["spec"]["template"]["spec"]["containers"][0]
    main["ports"] = [{"name": "karst", "containerPort": 7878}]
    for probe in ("startupProbe", "readinessProbe", "livenessProbe"):
        main[probe] = {"exec": {"command": ["true"]}}
    worker["spec"]["template"]["spec"]["containers"][0]["envFrom"] = [{"configMapRef": {"name": "settings"}}]
    return {
        "server": server,
        "worker": worker,
        "job": job,
        "settings": {
            "kind": "ConfigMap",
            "metadata": {"name": "settings"},
            "data": {"KARST_GRACE": "45", "KARST_TOKEN_FILE": "/etc/token"},
        },
        "service": {
            "kind": "Service",
            "metadata": {"name": "karst"},
            "spec": {"selector": {"role": "server"}, "ports": [{"port": 7878, "targetPort": "karst"}]},
        },
        "policy": {
            "kind": "NetworkPolicy",
            "metadata": {"name": "deny"},
            "spec": {"podSelector": {}, "policyTypes": ["Ingress", "Egress"]},
        },
        "budget": {
            "kind": "PodDisruptionBudget",
            "metadata": {"name": "server"},
            "spec": {"selector": {"matchLabels": {"role": "server"}}},
        },
        "scaler": {
            "kind": "HorizontalPodAutoscaler",
            "metadata": {"name": "worker"},
            "spec": {"scaleTargetRef": {"kind": "Deployment", "name": "worker"}},
        },
    }


REMOVED = object()

# (where, new value, what is found): one line per rule.
BREAKS = [
    ("server.pod.0.resources.requests.cpu", REMOVED, "resources.requests.cpu is missing"),
    ("server.pod.0.resources.limits.memory", REMOVED, "resources.limits.memory is missing"),
    ("worker.pod.0.securityContext.readOnlyRootFilesystem", False, "readOnlyRootFilesystem is not true"),
    ("worker.pod.0.securityContext.allowPrivilegeEscalation", REMOVED, "allowPrivilegeEscalation is not false"),
    ("worker.pod.0.securityContext.privileged", True, "privileged"),
    ("worker.pod.0.securityContext.capabilities", {"drop": ["NET_RAW"]}, "capabilities.drop has not ALL"),
    ("job.pod.0.securityContext.capabilities", {"drop": ["ALL"], "add": ["SYS_PTRACE"]}, "capabilities.add"),
    ("worker.pod.0.securityContext.runAsNonRoot", False, "runAsNonRoot is not true"),
    ("server.spec.securityContext.runAsNonRoot", REMOVED, "runAsNonRoot is not true"),
    ("worker.pod.0.securityContext.runAsUser", 0, "runAsUser is missing or 0"),
    ("server.spec.securityContext.runAsUser", REMOVED, "runAsUser is missing or 0"),
    ("server.spec.securityContext.seccompProfile", {"type": "Unconfined"}, "seccompProfile.type"),
    ("worker.pod.0.image", "karst", "no tag or the tag latest"),
    ("worker.pod.0.image", "registry:5000/karst:latest", "no tag or the tag latest"),
    ("worker.spec.hostNetwork", True, "hostNetwork"),
    ("worker.spec.volumes", [{"name": "data", "hostPath": {"path": "/"}}], "hostPath"),
    ("worker.spec.automountServiceAccountToken", REMOVED, "automountServiceAccountToken is not false"),
    ("worker.spec.enableServiceLinks", True, "enableServiceLinks is not false"),
    ("worker.spec.terminationGracePeriodSeconds", REMOVED, "terminationGracePeriodSeconds is missing"),
    ("server.pod.0.livenessProbe", REMOVED, "livenessProbe is missing"),
    ("server.pod.0.readinessProbe", REMOVED, "readinessProbe is missing"),
    ("server.pod.0.startupProbe", REMOVED, "startupProbe is missing"),
    ("policy.top.policyTypes", ["Ingress"], "no NetworkPolicy for Egress"),
    ("policy.top.podSelector", {"matchLabels": {"role": "server"}}, "Deployment/worker: no NetworkPolicy"),
    ("budget", REMOVED, "no PodDisruptionBudget"),
    ("budget.top.selector", {"matchLabels": {"role": "sever"}}, "PodDisruptionBudget/server: selects no pod"),
    ("settings.data.KARST_TOKEN", "a1b2c3", "looks like a secret"),
    ("settings.data.pem", "-----BEGIN PRIVATE KEY-----", "looks like a secret"),
    ("settings.kind", "Secret", "a secret is part of the build"),
    ("worker.pod.0.env", [{"name": "KARST_TOKEN", "value": "a1b2c3"}], "is written out"),
    ("worker.top.selector", {"matchLabels": {"role": "other"}}, "the selector does not match"),
    ("scaler.top.scaleTargetRef", {"kind": "Deployment", "name": "other"}, "which is not there"),
    ("service.top.selector", {"role": "other"}, "Service/karst: selects no pod"),
    ("service.top.ports", [{"port": 7878, "targetPort": "http"}], "port http is not a port of"),
    ("worker.pod.0.envFrom", [{"configMapRef": {"name": "other"}}], "ConfigMap/other, which nobody makes"),
    ("worker.spec.volumes", [{"name": "data", "secret": {"secretName": "other"}}], "Secret/other, which nobody"),
    ("worker.pod.0.volumeMounts", [{"name": "other", "mountPath": "/x"}], "not a volume of the pod"),
    ("job.top.podFailurePolicy", REMOVED, "exit codes 75 and 77 do not fail the job"),
    ("job.top.podFailurePolicy.rules", [{"action": "FailJob", "onExitCodes": {"values": [75, 77]}}], "disruption"),
    ("settings.data.KARST_GRACE", "60", "not below terminationGracePeriodSeconds"),
]

# Words that stand for longer paths.
SHORT = {"top": ["spec"], "spec": ["spec", "template", "spec"], "pod": ["spec", "template", "spec", "containers"]}


def broken(where, value):
    """The good set with one change."""
    docs = copy.deepcopy(good())
    name, *rest = where.split(".")
    path = (SHORT.get(rest[0], rest[:1]) + rest[1:]) if rest else []
    place, last = docs, name
    for step in path:
        place, last = place[last], int(step) if step.isdigit() else step
    if value is REMOVED:
        del place[last]
    else:
        place[last] = value
    return list(docs.values())


class Rules(unittest.TestCase):
    """Each rule takes what keeps it and finds what breaks it."""

    def test_what_keeps_every_rule_passes(self):
        self.assertEqual(check.findings(list(good().values())), [])

    def test_each_break_is_found(self):
        for where, value, message in BREAKS:
            with self.subTest(where=where, message=message):
                found = check.findings(broken(where, value))
                self.assertTrue(any(message in line for line in found), found)

    def test_every_rule_is_broken_once(self):
        for policy in check.POLICIES:
            with self.subTest(policy=policy.__name__):
                self.assertTrue(any(list(policy(broken(where, value))) for where, value, _ in BREAKS))

    def test_a_tag_or_a_digest_names_an_image(self):
        for image in ("karst:0.1.0", "registry:5000/karst:0.1.0", "karst@sha256:00", "registry:5000/karst@sha256:00"):
            self.assertEqual(list(check.image_rules(image)), [], image)
        for image in ("", "karst", "registry:5000/karst", "karst:latest"):
            self.assertEqual(len(list(check.image_rules(image))), 1, image)


if __name__ == "__main__":
    unittest.main()
