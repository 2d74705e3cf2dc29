//! What `squeue --json` says about arrays of pilots; the shapes of Slurm 21.08 to 24 are understood.

use std::collections::BTreeMap;
use std::os::unix::fs::MetadataExt as _;

use karst_client::Error;
use serde::Serialize;
use serde_json::Value;

use super::ranges::count;
use super::tools::call;

/// States of jobs that are over; squeue goes on to list them for some minutes.
const OVER: [&str; 10] = [
    "BOOT_FAIL",
    "CANCELLED",
    "COMPLETED",
    "DEADLINE",
    "FAILED",
    "NODE_FAIL",
    "OUT_OF_MEMORY",
    "PREEMPTED",
    "REVOKED",
    "TIMEOUT",
];

/// Tasks of one array in one state: one that has begun, or all that wait.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub(super) struct Tasks {
    /// Id of the array.
    pub(super) job: u64,
    /// Index, or the list of indexes that wait.
    pub(super) index: String,
    pub(super) count: u64,
    /// In Slurm's words, such as `RUNNING`.
    pub(super) state: String,
    /// Why it waits.
    pub(super) reason: String,
    pub(super) node: String,
    pub(super) restarts: u64,
}

impl Tasks {
    /// Whether they wait, run, or are on their way from one to the other.
    pub(super) fn are_alive(&self) -> bool {
        !OVER.contains(&self.state.as_str())
    }

    /// Whether they ended in another way than they should.
    pub(super) fn are_failed(&self) -> bool {
        !self.are_alive() && !["COMPLETED", "CANCELLED"].contains(&self.state.as_str())
    }
}

/// The tasks of this account with this job name and comment, in the order of arrays and indexes;
/// those that were over some minutes ago are among them.
///
/// # Errors
/// squeue cannot be run, or says something else than JSON.
pub(super) fn tasks(name: &str, comment: &str) -> Result<Vec<Tasks>, Error> {
    // Some versions ignore every filter beside --json.
    let said = call("squeue", &["--json"])?;
    let all: Value = serde_json::from_str(&said).map_err(|error| {
        Error::Failed(format!("squeue --json: expected JSON, as Slurm 21.08 and newer print it: {error}"))
    })?;
    let user = std::fs::metadata("/proc/self").map_or(0, |process| process.uid());
    Ok(of_json(&all, u64::from(user), name, comment))
}

fn of_json(all: &Value, user: u64, name: &str, comment: &str) -> Vec<Tasks> {
    let jobs = all["jobs"].as_array().map(Vec::as_slice).unwrap_or_default();
    let is_ours = |job: &&Value| {
        job["name"] == name && job["comment"] == comment && number(&job["user_id"]) == Some(user)
    };
    let mut list: Vec<Tasks> = jobs.iter().filter(is_ours).map(of_job).collect();
    list.sort_by_key(|tasks| (tasks.job, tasks.index.parse::<u64>().unwrap_or(u64::MAX)));
    list
}

fn of_job(job: &Value) -> Tasks {
    let waiting = text(&job["array_task_string"]);
    let index = number(&job["array_task_id"]).map(|index| index.to_string());
    let own = number(&job["job_id"]).unwrap_or(0);
    Tasks {
        job: number(&job["array_job_id"]).filter(|id| *id > 0).unwrap_or(own),
        count: if waiting.is_empty() { 1 } else { count(&waiting).unwrap_or(1) },
        index: if waiting.is_empty() { index.unwrap_or_default() } else { waiting },
        state: text(&job["job_state"]),
        reason: text(&job["state_reason"]),
        node: text(&job["nodes"]),
        restarts: number(&job["restart_cnt"]).unwrap_or(0),
    }
}

/// A number, or since Slurm 23.02 `{"set": true, "number": 7}`.
fn number(value: &Value) -> Option<u64> {
    let is_set = value.get("set").and_then(Value::as_bool).unwrap_or(true);
    value.as_u64().or_else(|| value.get("number").and_then(Value::as_u64).filter(|_| is_set))
}

/// A word, or since Slurm 23.11 a list of them, of which the first counts.
fn text(value: &Value) -> String {
    let first = value.as_array().and_then(|list| list.first()).unwrap_or(value);
    first.as_str().unwrap_or_default().to_owned()
}

/// How many tasks are in each state.
pub(super) fn states(tasks: &[Tasks]) -> BTreeMap<String, u64> {
    let mut states = BTreeMap::new();
    for task in tasks {
        *states.entry(task.state.clone()).or_default() += task.count;
    }
    states
}

/// Tasks that have begun and those that wait.
pub(super) fn running_and_waiting(tasks: &[Tasks]) -> (u64, u64) {
    let states = states(tasks);
    let of = |state: &str| states.get(state).copied().unwrap_or(0);
    (of("RUNNING"), of("PENDING"))
}

#[cfg(test)]
mod tests {
    use super::{of_json, running_and_waiting};
    use serde_json::{Value, json};

    /// Three running tasks and seven that wait, as Slurm 22.05 says it.
    fn old() -> Value {
        let running = |index: u32| {
            json!({"job_id": 40 + index, "array_job_id": 40, "array_task_id": index, "array_task_string": "",
                   "job_state": "RUNNING", "state_reason": "None", "comment": "karst server=http://a:1",
                   "name": "karst-workers", "user_id": 1000, "nodes": format!("n{index}"), "restart_cnt": 1})
        };
        let waiting = json!({"job_id": 40, "array_job_id": 40, "array_task_id": null,
            "array_task_string": "3-9%3", "job_state": "PENDING", "state_reason": "JobArrayTaskLimit",
            "comment": "karst server=http://a:1", "name": "karst-workers", "user_id": 1000, "nodes": ""});
        let mut other = running(5);
        other["comment"] = "karst server=http://b:1".into();
        let mut stranger = running(6);
        stranger["user_id"] = 1001.into();
        let mut film = running(7);
        film["name"] = "karst-frames".into();
        json!({"jobs": [waiting, running(2), running(0), running(1), other, stranger, film]})
    }

    #[test]
    fn only_our_own_pilots_of_this_server_count() {
        let tasks = of_json(&old(), 1000, "karst-workers", "karst server=http://a:1");
        assert_eq!(running_and_waiting(&tasks), (3, 7));
        let indexes: Vec<&str> = tasks.iter().map(|task| task.index.as_str()).collect();
        assert_eq!(indexes, ["0", "1", "2", "3-9%3"]);
        assert_eq!((tasks[1].node.as_str(), tasks[1].restarts, tasks[1].job), ("n1", 1, 40));
        assert!(of_json(&json!({}), 1000, "karst-workers", "x").is_empty());
    }

    #[test]
    fn what_is_over_is_told_from_what_is_not() {
        let mut all = old();
        for (index, state) in ["FAILED", "COMPLETED", "COMPLETING"].into_iter().enumerate() {
            all["jobs"][index + 1]["job_state"] = state.into();
        }
        let tasks = of_json(&all, 1000, "karst-workers", "karst server=http://a:1");
        let alive: Vec<bool> = tasks.iter().map(super::Tasks::are_alive).collect();
        let failed: Vec<bool> = tasks.iter().map(super::Tasks::are_failed).collect();
        assert_eq!((alive, failed), (vec![false, true, false, true], vec![false, false, true, false]));
        assert_eq!(running_and_waiting(&tasks), (0, 7));
    }

    #[test]
    fn newer_versions_wrap_numbers_and_states() {
        let wrapped = |set: bool, number: u32| json!({"set": set, "infinite": false, "number": number});
        let job = json!({"job_id": 41, "array_job_id": wrapped(true, 40), "array_task_id": wrapped(true, 1),
            "array_task_string": "", "job_state": ["RUNNING", "CONFIGURING"], "state_reason": "None",
            "comment": "c", "name": "karst-workers", "user_id": 7, "nodes": "n1", "restart_cnt": 0});
        let waiting = json!({"job_id": 40, "array_job_id": wrapped(true, 40), "array_task_id": wrapped(false, 0),
            "array_task_string": "2,4-8:2", "job_state": ["PENDING"], "comment": "c", "name": "karst-workers",
            "user_id": 7, "nodes": ""});
        let tasks = of_json(&json!({"jobs": [job, waiting]}), 7, "karst-workers", "c");
        assert_eq!(running_and_waiting(&tasks), (1, 4));
        assert_eq!((tasks[0].job, tasks[0].index.as_str()), (40, "1"));
    }
}
