//! Owns what must survive, in SQL: the only module with statements.
//!
//! `SQLite` in WAL mode with full syncs: what a call here has answered survives a power cut.
//! One connection writes (transactions never wait for each other inside `SQLite`), four read.
//! Times, digests and states are plain text and integers, so that the statements hold for Postgres as well.

mod read;
mod write;

use std::path::Path;
use std::time::Duration;

use sqlx::migrate::{Migration, MigrationType, Migrator};
use sqlx::sqlite::{
    SqliteConnectOptions, SqliteJournalMode, SqlitePool, SqlitePoolOptions, SqliteSynchronous,
};

pub use crate::state::read::{Census, StoredJob, StoredLease, StoredRound};
pub use crate::state::write::{Row, Submission, Submitted};

use crate::error::Error;

/// The database.
#[derive(Debug, Clone)]
pub struct State {
    write: SqlitePool,
    read: SqlitePool,
}

impl State {
    /// Opens the database file, makes it if it is not there, and brings its tables up to date.
    ///
    /// # Errors
    /// When the file cannot be opened, is of a newer version, or the disk fails.
    pub async fn open(file: &Path) -> Result<Self, Error> {
        let options = SqliteConnectOptions::new()
            .filename(file)
            .create_if_missing(true)
            .journal_mode(SqliteJournalMode::Wal)
            .synchronous(SqliteSynchronous::Full)
            .foreign_keys(true)
            .busy_timeout(Duration::from_secs(10));
        let write = SqlitePoolOptions::new().max_connections(1).connect_with(options.clone()).await?;
        migrator().run(&write).await.map_err(|e| Error::Database(format!("{}: {e}", file.display())))?;
        let read = SqlitePoolOptions::new().max_connections(4).connect_with(options.read_only(true)).await?;
        Ok(Self { write, read })
    }

    /// Ends all connections; what was committed is in the file.
    pub async fn close(&self) {
        self.read.close().await;
        self.write.close().await;
    }
}

fn migrator() -> Migrator {
    const STEPS: [(&str, &str); 3] = [
        ("first light", include_str!("../../migrations/0001_first_light.sql")),
        ("workers", include_str!("../../migrations/0002_workers.sql")),
        ("census", include_str!("../../migrations/0003_census.sql")),
    ];
    let step = |(version, (name, sql)): (i64, (&'static str, &'static str))| {
        let sql = sqlx::SqlSafeStr::into_sql_str(sql);
        Migration::new(version, name.into(), MigrationType::Simple, sql, false)
    };
    Migrator::with_migrations((1..).zip(STEPS).map(step).collect())
}

/// State enums are stored as the text of their serde names.
fn name_of(state: impl serde::Serialize) -> String {
    to_json(&state).trim_matches('"').to_owned()
}

fn to_json(value: &impl serde::Serialize) -> String {
    serde_json::to_string(value).expect("plain data with text keys always becomes JSON")
}

fn from_json<T: serde::de::DeserializeOwned>(text: &str) -> Result<T, Error> {
    serde_json::from_str(text).map_err(|e| Error::Database(format!("a stored row is damaged: {e}")))
}

fn parse_digest(text: &str) -> Result<crate::digest::Digest, Error> {
    text.parse().map_err(|e| Error::Database(format!("a stored digest is damaged: {e}")))
}

#[cfg(test)]
mod tests;
