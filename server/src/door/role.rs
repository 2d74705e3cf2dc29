//! Owns the roles, and which calls each one may make. A call that is not in the table needs `admin`.

use std::fmt;
use std::str::FromStr;

/// What the bearer of a token may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Role {
    /// Look at jobs, frames and previews.
    View,
    /// Besides, submit and stop jobs.
    Submit,
    /// Render tasks: what a worker needs and nothing else.
    Work,
    /// Everything.
    Admin,
}

/// Everybody, for calls that tell nothing.
const OPEN: &[&str] = &["/grpc.health.v1.Health/Check", "/grpc.health.v1.Health/Watch"];

/// Calls of `view`, which `submit` may make as well.
const VIEW: &[&str] = &[
    "/grpc.health.v1.Health/List",
    "/grpc.reflection.v1.ServerReflection/ServerReflectionInfo",
    "/karst.v1.Jobs/GetJob",
    "/karst.v1.Jobs/ListJobs",
    "/karst.v1.Jobs/WatchJob",
    "/karst.v1.Frames/ListFrames",
    "/karst.v1.Frames/CollectTiles",
    "/karst.v1.Frames/DownloadFrame",
    "/karst.v1.Previews/StreamTiles",
    "/metrics",
];

/// Calls of `submit`.
const SUBMIT: &[&str] = &[
    "/karst.v1.Assets/FindMissing",
    "/karst.v1.Assets/Upload",
    "/karst.v1.Assets/QueryUpload",
    "/karst.v1.Jobs/SubmitJob",
    "/karst.v1.Jobs/CancelJob",
];

/// Calls of `work`.
const WORK: &[&str] =
    &["/karst.v1.Assets/Download", "/karst.v1.Workers/UpdateWorkerSession", "/karst.v1.Workers/GetJobSpec"];

impl Role {
    /// All roles.
    pub const ALL: [Self; 4] = [Self::View, Self::Submit, Self::Work, Self::Admin];

    /// Whether the role may make the call with this path, such as `/karst.v1.Jobs/GetJob`.
    pub fn may(self, path: &str) -> bool {
        match self {
            Self::Admin => true,
            Self::View => VIEW.contains(&path),
            Self::Submit => VIEW.contains(&path) || SUBMIT.contains(&path),
            Self::Work => WORK.contains(&path),
        }
    }

    /// Whether a call needs no token at all.
    pub(crate) fn nobody_needs(path: &str) -> bool {
        OPEN.contains(&path)
    }

    /// The roles that may make a call, for the message that refuses it.
    pub(crate) fn that_may(path: &str) -> String {
        let names = Self::ALL.iter().filter(|role| role.may(path)).map(Self::to_string);
        names.collect::<Vec<_>>().join(" or ")
    }
}

impl fmt::Display for Role {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::View => "view",
            Self::Submit => "submit",
            Self::Work => "work",
            Self::Admin => "admin",
        })
    }
}

impl FromStr for Role {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let known = Self::ALL.into_iter().find(|role| role.to_string() == text);
        known.ok_or_else(|| format!("found {text:?}, expected view, submit, work or admin"))
    }
}

#[cfg(test)]
mod tests {
    use super::{OPEN, Role, SUBMIT, VIEW, WORK};
    use karst_proto::FILE_DESCRIPTOR_SET;
    use prost::Message as _;
    use prost_types::FileDescriptorSet;
    use std::collections::BTreeSet;

    /// Every call of the protos is in exactly one list, and nothing else is: a new call is `admin` until somebody
    /// has thought about it.
    #[test]
    fn every_call_has_its_place() {
        let files = FileDescriptorSet::decode(FILE_DESCRIPTOR_SET).unwrap().file;
        let mut calls = BTreeSet::new();
        for file in files.iter().filter(|f| f.package() == "karst.v1") {
            for service in &file.service {
                let path = |m: &prost_types::MethodDescriptorProto| {
                    format!("/karst.v1.{}/{}", service.name(), m.name())
                };
                calls.extend(service.method.iter().map(path));
            }
        }
        let listed: Vec<&str> =
            [VIEW, SUBMIT, WORK].concat().into_iter().filter(|c| c.contains("karst")).collect();
        assert_eq!(listed.len(), listed.iter().collect::<BTreeSet<_>>().len(), "a call is in two lists");
        assert_eq!(listed.iter().map(ToString::to_string).collect::<BTreeSet<_>>(), calls);
        assert!(OPEN.iter().all(|call| call.starts_with("/grpc.health.")));
    }

    #[test]
    fn roles_hold_each_other_apart() {
        let may = |role: Role, path: &str| role.may(path);
        assert!(
            may(Role::Submit, "/karst.v1.Jobs/SubmitJob") && !may(Role::View, "/karst.v1.Jobs/SubmitJob")
        );
        assert!(
            may(Role::Work, "/karst.v1.Assets/Download") && !may(Role::Submit, "/karst.v1.Assets/Download")
        );
        assert!(!may(Role::Work, "/karst.v1.Jobs/GetJob"));
        assert!(may(Role::Admin, "/karst.v1.Jobs/Whatever") && !may(Role::View, "/karst.v1.Jobs/Whatever"));
        assert_eq!(Role::that_may("/karst.v1.Jobs/GetJob"), "view or submit or admin");
        assert!("root".parse::<Role>().unwrap_err().contains("admin"));
    }
}
