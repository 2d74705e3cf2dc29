//! Who may call what: each role against each call of a real server.

#![allow(clippy::unwrap_used, reason = "a test says with unwrap what must hold")]

mod support;

use std::path::Path;
use std::process::Command;

use karst_core::scene::Overrides;
use karst_proto::FILE_DESCRIPTOR_SET;
use karst_proto::connect::{Bearer, endpoint};
use karst_proto::v1::JobState;
use karst_server::door::{Role, line, new_token};
use prost::Message as _;
use prost_types::FileDescriptorSet;
use support::program::Program;
use support::{Client, TestServer, hash, raw, refusal, render_locally, request_id, scene_text};
use tonic::{Code, Status};

/// Every call of the protos, and those of the standard services.
fn calls() -> Vec<String> {
    let files = FileDescriptorSet::decode(FILE_DESCRIPTOR_SET).unwrap().file;
    let mut calls = vec!["/grpc.reflection.v1.ServerReflection/ServerReflectionInfo".to_owned()];
    for file in files.iter().filter(|f| f.package() == "karst.v1") {
        for service in &file.service {
            calls.extend(service.method.iter().map(|m| format!("/karst.v1.{}/{}", service.name(), m.name())));
        }
    }
    assert!(calls.len() > 15, "{calls:?}");
    calls
}

/// What the door said to a call, if it said anything.
fn refused_at_the_door(answer: Result<Vec<u8>, Status>) -> Option<Code> {
    let status = answer.err()?;
    let reason = karst_proto::errors::reason(&status).map(|r| r.as_str_name());
    matches!(reason, Some("TOKEN_REFUSED" | "ROLE_INSUFFICIENT")).then_some(status.code())
}

#[tokio::test(flavor = "multi_thread")]
async fn each_role_against_each_call() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 1).await;
    let tokens = Role::ALL.map(|role| (role, new_token()));
    let lines: Vec<String> = tokens.iter().map(|(role, token)| line(*role, "someone", token)).collect();
    std::fs::write(dir.path().join("tokens"), lines.join("\n")).unwrap();
    for (role, token) in &tokens {
        let client = Client::connect(&server.url, token).await;
        for call in calls() {
            let refused = refused_at_the_door(raw::call(client.channel.clone(), &call, Vec::new()).await);
            let expected = (!role.may(&call)).then_some(Code::PermissionDenied);
            assert_eq!(refused, expected, "{role} calls {call}");
        }
    }
    for token in ["", "wrong", &new_token()] {
        let stranger = Client::connect(&server.url, token).await;
        for call in calls() {
            let refused = refused_at_the_door(raw::call(stranger.channel.clone(), &call, Vec::new()).await);
            assert_eq!(refused, Some(Code::Unauthenticated), "a stranger calls {call}");
        }
        let check = raw::call(stranger.channel.clone(), "/grpc.health.v1.Health/Check", Vec::new()).await;
        assert!(check.is_ok(), "health tells everybody: {check:?}");
    }
    server.stop().await;
}

#[tokio::test(flavor = "multi_thread")]
async fn a_refusal_says_what_to_do_and_a_removed_token_is_refused_at_once() {
    let dir = tempfile::tempdir().unwrap();
    let server = TestServer::start(dir.path(), 1).await;
    let token = new_token();
    std::fs::write(dir.path().join("tokens"), line(Role::View, "eye", &token)).unwrap();
    let mut eye = Client::connect(&server.url, &token).await;
    let get = || karst_proto::v1::GetJobRequest { job: "none".into() };
    assert_eq!(eye.jobs.get_job(get()).await.unwrap_err().code(), Code::NotFound);
    let cancel = karst_proto::v1::CancelJobRequest { job: "none".into() };
    let status = eye.jobs.cancel_job(cancel).await.unwrap_err();
    for part in ["/karst.v1.Jobs/CancelJob", "\"eye\"", "view", "submit or admin"] {
        assert!(status.message().contains(part), "{part}: {status}");
    }
    assert!(!format!("{status:?}").contains(&token), "the token itself is never shown");
    std::fs::remove_file(dir.path().join("tokens")).unwrap();
    let refused = refusal(eye.jobs.get_job(get()).await);
    assert_eq!(refused, (Code::Unauthenticated, "TOKEN_REFUSED".to_owned()));
    server.stop().await;
}

#[test]
fn tokens_are_made_by_the_program() {
    let dir = tempfile::tempdir().unwrap();
    let output = Command::new(env!("CARGO_BIN_EXE_karst-server"))
        .args(["token", "new", "--role", "work", "--name", "farm", "--data"])
        .arg(dir.path())
        .output()
        .unwrap();
    let text = String::from_utf8(output.stdout).unwrap();
    let token = text.lines().find_map(|l| l.strip_prefix("token: ")).unwrap();
    let known = std::fs::read_to_string(dir.path().join("tokens")).unwrap();
    assert_eq!(known.trim(), line(Role::Work, "farm", token));
    assert!(text.contains(known.trim()) && Bearer::new(token).is_ok());
}

/// A server that other machines can reach, with a certificate of its own: a worker and a client with the right
/// tokens render a job, and nothing in the clear gets an answer.
#[tokio::test(flavor = "multi_thread")]
async fn beyond_loopback_everything_is_encrypted() {
    let dir = tempfile::tempdir().unwrap();
    let data = dir.path().join("data");
    let program = || Command::new(env!("CARGO_BIN_EXE_karst-server"));
    let mut init = program();
    init.args(["token", "init", "--tls", "--name", "localhost", "--name", "127.0.0.1", "--data"]).arg(&data);
    assert!(init.output().unwrap().status.success());
    let ca = data.join("tls/cert.pem");
    let tokens = [Role::Submit, Role::Work].map(|role| (role, new_token()));
    let lines: Vec<String> = tokens.iter().map(|(role, token)| line(*role, "x", token)).collect();
    std::fs::write(data.join("tokens"), lines.join("\n")).unwrap();
    let [(_, submit), (_, work)] = &tokens;
    std::fs::write(dir.path().join("work"), work).unwrap();

    let server = Program::start_on(&data, 0, "0.0.0.0:0");
    let url = server.url.replace("0.0.0.0", "localhost");
    assert!(url.starts_with("https://"), "{url}");
    let health = |url: &str, ca: Option<&Path>| {
        let mut asked = program();
        asked.args(["health", "--server", url]);
        asked.args(ca.into_iter().flat_map(|ca| [Path::new("--ca-file"), ca]));
        let output = asked.output().unwrap();
        (output.status.success(), String::from_utf8(output.stderr).unwrap())
    };
    assert_eq!(health(&url, Some(&ca)), (true, String::new()));
    let (serves, text) = health(&url, None);
    assert!(!serves && text.contains("certificate"), "an unknown certificate: {text}");
    let (serves, text) = health(&url.replace("https", "http"), None);
    assert!(!serves, "in the clear: {text}");

    let mut worker = program()
        .args(["work", "--threads", "1", "--log", "warn", "--server", &url, "--cache"])
        .arg(dir.path().join("cache"))
        .arg("--token-file")
        .arg(dir.path().join("work"))
        .arg("--ca-file")
        .arg(&ca)
        .spawn()
        .unwrap();
    let channel = endpoint(&url, Some(&ca)).unwrap().connect().await.unwrap();
    let mut client = Client::over(channel, submit);
    let text = scene_text((64, 48), r#"{"spp": 8}"#, "");
    let spec = client.spec(&text).await;
    let job = client.submit(&request_id("tls"), &spec).await.unwrap().id;
    assert_eq!(client.finish(&job).await.state(), JobState::Succeeded);
    let local = render_locally(&text, 1, &Overrides::default(), 64);
    assert_eq!(hash(&client.collect(&job, 1).await.unwrap()), hash(&local));
    worker.kill().unwrap();
    worker.wait().unwrap();
}

#[test]
fn a_worker_without_the_right_token_ends_and_says_so() {
    let dir = tempfile::tempdir().unwrap();
    let server = Program::start(dir.path(), 1);
    std::fs::write(dir.path().join("wrong"), new_token()).unwrap();
    let worker = Command::new(env!("CARGO_BIN_EXE_karst-server"))
        .args(["work", "--threads", "1", "--server", &server.url, "--cache"])
        .arg(dir.path().join("cache"))
        .arg("--token-file")
        .arg(dir.path().join("wrong"))
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&worker.stderr);
    assert_eq!(worker.status.code(), Some(77), "{text}");
    assert!(text.contains("this token is not known here"), "{text}");
}
