//! Owns the reading statements.

use std::collections::{BTreeMap, BTreeSet};

use sqlx::Row as _;
use sqlx::sqlite::SqliteRow;

use crate::digest::Digest;
use crate::error::Error;
use crate::job::JobRun;
use crate::model::{Frame, Job, JobState, Record};
use crate::past::Past;
use crate::spec::JobSpec;
use crate::state::{State, from_json, name_of, parse_digest};

/// A job with its place in the queue.
#[derive(Debug)]
pub struct StoredJob {
    /// Rises with the order of submission.
    pub number: i64,
    /// The job and its frames.
    pub run: JobRun,
}

/// Numbers by the names of states.
pub type Census = BTreeMap<String, u64>;

/// Where a frame can go on after a crash.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct StoredRound {
    /// Rounds that are in the film; the packs belong to the round of this index.
    pub rounds: u32,
    /// The film after these rounds; `None` before the first.
    pub film: Option<Digest>,
    /// Results of the round that was being rendered.
    pub packs: Vec<Digest>,
}

/// Tasks that a worker was given.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct StoredLease {
    /// Its number.
    pub fence: u64,
    /// The worker's id.
    pub worker: String,
    /// The job's id.
    pub job: String,
    /// Frame number.
    pub frame: i32,
    /// Index of the round.
    pub round: u32,
    /// The tiles.
    pub tiles: Vec<u32>,
}

impl State {
    /// A job as it is now, without its files.
    ///
    /// # Errors
    /// [`Error::JobNotFound`]; a failing database.
    pub async fn job(&self, id: &str) -> Result<Job, Error> {
        let row =
            sqlx::query("SELECT job FROM jobs WHERE id = $1").bind(id).fetch_optional(&self.read).await?;
        from_json(row.ok_or_else(|| Error::JobNotFound(id.to_owned()))?.get("job"))
    }

    /// What a job asks for, with its files.
    ///
    /// # Errors
    /// [`Error::JobNotFound`]; a failing database.
    pub async fn spec(&self, id: &str) -> Result<JobSpec, Error> {
        let row = sqlx::query("SELECT files, job FROM jobs WHERE id = $1")
            .bind(id)
            .fetch_optional(&self.read)
            .await?
            .ok_or_else(|| Error::JobNotFound(id.to_owned()))?;
        let job: Job = from_json(row.get("job"))?;
        Ok(JobSpec { files: from_json(row.get("files"))?, ..job.spec })
    }

    /// Up to `limit` jobs in one of `states` (all when empty) whose number is below `before`, the newest first.
    ///
    /// # Errors
    /// A failing database.
    pub async fn jobs(&self, states: &[JobState], before: i64, limit: u32) -> Result<Vec<(i64, Job)>, Error> {
        // A fixed statement for any set of states: the set travels as text, each name between commas.
        let names = states.iter().map(name_of).fold(String::new(), |names, name| names + "," + &name + ",");
        let rows = sqlx::query(
            "SELECT number, job FROM jobs \
             WHERE number < $1 AND ($2 = '' OR $2 LIKE '%,' || state || ',%') ORDER BY number DESC LIMIT $3",
        )
        .bind(before)
        .bind(names)
        .bind(i64::from(limit))
        .fetch_all(&self.read)
        .await?;
        rows.iter().map(|row| Ok((row.get("number"), from_json(row.get("job"))?))).collect()
    }

    /// Up to `limit` frames of a job whose number is at least `from`, in order.
    ///
    /// # Errors
    /// A failing database.
    pub async fn frames(&self, job: &str, from: i32, limit: u32) -> Result<Vec<Frame>, Error> {
        let rows =
            sqlx::query("SELECT details FROM frames WHERE job = $1 AND frame >= $2 ORDER BY frame LIMIT $3")
                .bind(job)
                .bind(from)
                .bind(i64::from(limit))
                .fetch_all(&self.read)
                .await?;
        rows.iter().map(|row| from_json(row.get("details"))).collect()
    }

    /// One frame of a job as it is now.
    ///
    /// # Errors
    /// [`Error::JobNotFound`], [`Error::FrameNotFound`]; a failing database.
    pub async fn frame(&self, job: &str, frame: i32) -> Result<Frame, Error> {
        let row = sqlx::query("SELECT details FROM frames WHERE job = $1 AND frame = $2")
            .bind(job)
            .bind(frame)
            .fetch_optional(&self.read)
            .await?;
        if let Some(row) = row {
            return from_json(row.get("details"));
        }
        self.job(job).await?;
        Err(Error::FrameNotFound(job.to_owned(), frame))
    }

    /// Up to `limit` records of a job after a revision, in order, without gap.
    ///
    /// # Errors
    /// A failing database.
    pub async fn records(&self, job: &str, after: u64, limit: u32) -> Result<Vec<(u64, Record)>, Error> {
        let rows = sqlx::query(
            "SELECT revision, record FROM records WHERE job = $1 AND revision > $2 ORDER BY revision LIMIT $3",
        )
        .bind(job)
        .bind(i64::try_from(after).unwrap_or(i64::MAX))
        .bind(i64::from(limit))
        .fetch_all(&self.read)
        .await?;
        let record =
            |row: &SqliteRow| Ok((row.get::<i64, _>("revision") as u64, from_json(row.get("record"))?));
        rows.iter().map(record).collect()
    }

    /// All leases of rounds that are being rendered.
    ///
    /// # Errors
    /// A failing database.
    pub async fn leases(&self) -> Result<Vec<StoredLease>, Error> {
        let rows = sqlx::query("SELECT fence, worker, job, frame, round, tiles FROM leases ORDER BY fence")
            .fetch_all(&self.read)
            .await?;
        let lease = |row: &SqliteRow| {
            Ok(StoredLease {
                fence: row.get::<i64, _>("fence") as u64,
                worker: row.get("worker"),
                job: row.get("job"),
                frame: row.get("frame"),
                round: row.get::<i64, _>("round") as u32,
                tiles: from_json(row.get("tiles"))?,
            })
        };
        rows.iter().map(lease).collect()
    }

    /// What has gone wrong with the tiles of a round.
    ///
    /// # Errors
    /// A failing database.
    pub(crate) async fn past(&self, job: &str, frame: i32, round: u32) -> Result<BTreeMap<u32, Past>, Error> {
        let rows = sqlx::query("SELECT tile, past FROM pasts WHERE job = $1 AND frame = $2 AND round = $3")
            .bind(job)
            .bind(frame)
            .bind(i64::from(round))
            .fetch_all(&self.read)
            .await?;
        rows.iter().map(|row| Ok((row.get::<i64, _>("tile") as u32, from_json(row.get("past"))?))).collect()
    }

    /// Where a frame can go on.
    ///
    /// # Errors
    /// A failing database.
    pub async fn round(&self, job: &str, frame: i32) -> Result<StoredRound, Error> {
        let row = sqlx::query("SELECT film, rounds FROM frames WHERE job = $1 AND frame = $2")
            .bind(job)
            .bind(frame)
            .fetch_optional(&self.read)
            .await?;
        let Some(row) = row else { return Ok(StoredRound::default()) };
        let rounds: i64 = row.get("rounds");
        let film: Option<String> = row.get("film");
        let packs = sqlx::query("SELECT pack FROM results WHERE job = $1 AND frame = $2 AND round = $3")
            .bind(job)
            .bind(frame)
            .bind(rounds)
            .fetch_all(&self.read)
            .await?;
        Ok(StoredRound {
            rounds: u32::try_from(rounds).map_err(|_| Error::Database(format!("{rounds} rounds")))?,
            film: film.as_deref().map(parse_digest).transpose()?,
            packs: packs.iter().map(|row| parse_digest(row.get("pack"))).collect::<Result<_, _>>()?,
        })
    }

    /// All jobs that are not in a final state, in the order of their submission.
    ///
    /// # Errors
    /// A failing database.
    pub async fn unfinished(&self) -> Result<Vec<StoredJob>, Error> {
        let rows = sqlx::query(
            "SELECT number, files, job FROM jobs WHERE state IN ('Queued', 'Running') ORDER BY number",
        )
        .fetch_all(&self.read)
        .await?;
        let mut jobs = Vec::with_capacity(rows.len());
        for row in rows {
            let mut job: Job = from_json(row.get("job"))?;
            job.spec.files = from_json(row.get("files"))?;
            let frames = self.frames(&job.id, i32::MIN, u32::MAX).await?;
            jobs.push(StoredJob { number: row.get("number"), run: JobRun::new(job, frames) });
        }
        Ok(jobs)
    }

    /// Whether a row refers to this blob as a pack or a film: frames and jobs with the same bytes share one.
    ///
    /// # Errors
    /// A failing database.
    pub async fn is_needed(&self, digest: &Digest) -> Result<bool, Error> {
        let rows: i64 = sqlx::query_scalar(
            "SELECT (SELECT COUNT(*) FROM results WHERE pack = $1) + (SELECT COUNT(*) FROM frames WHERE film = $1)",
        )
        .bind(digest.to_string())
        .fetch_one(&self.read)
        .await?;
        Ok(rows > 0)
    }

    /// How many jobs and how many frames there are, by the names of their states.
    ///
    /// # Errors
    /// A failing database.
    pub async fn census(&self) -> Result<(Census, Census), Error> {
        let counts = |rows: Vec<SqliteRow>| {
            rows.iter().map(|row| (row.get("state"), row.get::<i64, _>("number") as u64)).collect()
        };
        let jobs = sqlx::query("SELECT state, COUNT(*) AS number FROM jobs GROUP BY state");
        let frames = sqlx::query("SELECT state, COUNT(*) AS number FROM frames GROUP BY state");
        let jobs = counts(jobs.fetch_all(&self.read).await?);
        Ok((jobs, counts(frames.fetch_all(&self.read).await?)))
    }

    /// All packs that rows refer to.
    ///
    /// # Errors
    /// A failing database.
    pub async fn packs(&self) -> Result<BTreeSet<Digest>, Error> {
        let rows: Vec<String> = sqlx::query_scalar("SELECT pack FROM results").fetch_all(&self.read).await?;
        rows.iter().map(|text| parse_digest(text)).collect()
    }

    /// All films that rows refer to.
    ///
    /// # Errors
    /// A failing database.
    pub async fn films(&self) -> Result<BTreeSet<Digest>, Error> {
        let rows: Vec<String> = sqlx::query_scalar("SELECT film FROM frames WHERE film IS NOT NULL")
            .fetch_all(&self.read)
            .await?;
        rows.iter().map(|text| parse_digest(text)).collect()
    }
}
