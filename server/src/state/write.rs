//! Owns the writing statements.

use sqlx::{Row as _, Sqlite, Transaction};

use crate::digest::Digest;
use crate::error::Error;
use crate::model::{Frame, Job, Record};
use crate::past::Past;
use crate::state::{State, StoredLease, from_json, name_of, to_json};

/// A job that wants to be stored.
#[derive(Debug)]
pub struct Submission<'a> {
    /// Chosen by the client.
    pub request_id: &'a str,
    /// Digest of the request's body: the same id with another body is refused.
    pub body: Digest,
    /// The job, revision 1.
    pub job: &'a Job,
    /// Its frames, all pending.
    pub frames: &'a [i32],
}

/// What became of a submission.
#[derive(Debug)]
pub enum Submitted {
    /// Stored; the number tells its place in the queue.
    New(i64),
    /// The same request came before: the job as it is now.
    Known(Box<Job>),
}

/// One change; a slice of them is stored together or not at all.
#[derive(Debug, Clone)]
pub enum Row {
    /// The newest state of a job.
    Job(Box<Job>),
    /// The newest state of a frame.
    Frame(String, Box<Frame>),
    /// Something that watchers are told: job, revision, record.
    Record(String, u64, Record),
    /// Results of the round that is being rendered.
    Pack {
        /// The job's id.
        job: String,
        /// Frame number.
        frame: i32,
        /// The round of all results in the pack.
        round: u32,
        /// The blob.
        pack: Digest,
    },
    /// A frame's film after a round; the packs it contains are forgotten.
    Film {
        /// The job's id.
        job: String,
        /// Frame number.
        frame: i32,
        /// Rounds that are in it.
        rounds: u32,
        /// The blob.
        film: Digest,
    },
    /// One pack takes the place of all others of the round.
    ReplacePacks {
        /// The job's id.
        job: String,
        /// Frame number.
        frame: i32,
        /// The round of all results in the pack.
        round: u32,
        /// The blob.
        pack: Digest,
    },
    /// A job or frame has ended: its packs, leases and pasts are forgotten.
    Forget(String, i32),
    /// Tasks were given to a worker.
    Lease(StoredLease),
    /// Something has gone wrong with a tile: job, frame, round, tile.
    Past(String, i32, u32, u32, Past),
}

impl State {
    /// Stores a job, unless the same request came before.
    ///
    /// # Errors
    /// [`Error::RequestIdReused`] when it came with another body; a failing database.
    pub async fn submit(&self, new: Submission<'_>) -> Result<Submitted, Error> {
        let mut tx = self.write.begin().await?;
        let known = sqlx::query("SELECT body, job FROM jobs WHERE request_id = $1")
            .bind(new.request_id)
            .fetch_optional(&mut *tx)
            .await?;
        if let Some(row) = known {
            return known_request(new.request_id, &new.body, row.get("body"), row.get("job"));
        }
        let number: i64 = sqlx::query_scalar(
            "INSERT INTO jobs (number, id, request_id, body, state, revision, files, job) \
             SELECT COALESCE(MAX(number), 0) + 1, $1, $2, $3, $4, $5, $6, $7 FROM jobs RETURNING number",
        )
        .bind(&new.job.id)
        .bind(new.request_id)
        .bind(new.body.to_string())
        .bind(name_of(new.job.state))
        .bind(new.job.revision as i64)
        .bind(to_json(&new.job.spec.files))
        .bind(to_json(new.job))
        .fetch_one(&mut *tx)
        .await?;
        for frame in new.frames {
            let frame = Frame::pending(*frame);
            sqlx::query("INSERT INTO frames (job, frame, state, details, rounds) VALUES ($1, $2, $3, $4, 0)")
                .bind(&new.job.id)
                .bind(frame.frame)
                .bind(name_of(frame.state))
                .bind(to_json(&frame))
                .execute(&mut *tx)
                .await?;
        }
        let record = Record::Snapshot(Box::new(new.job.clone()));
        write(&mut tx, &Row::Record(new.job.id.clone(), new.job.revision, record)).await?;
        tx.commit().await?;
        Ok(Submitted::New(number))
    }

    /// The job that an earlier request with this id made.
    ///
    /// # Errors
    /// [`Error::RequestIdReused`] when it came with another body; a failing database.
    pub async fn known(&self, request_id: &str, body: &Digest) -> Result<Option<Box<Job>>, Error> {
        let known = sqlx::query("SELECT body, job FROM jobs WHERE request_id = $1")
            .bind(request_id)
            .fetch_optional(&self.read)
            .await?;
        let Some(row) = known else { return Ok(None) };
        match known_request(request_id, body, row.get("body"), row.get("job"))? {
            Submitted::Known(job) => Ok(Some(job)),
            Submitted::New(_) => Ok(None),
        }
    }

    /// Counts a start of the server: 1 for the first. Fences of different starts differ by it.
    ///
    /// # Errors
    /// A failing database.
    pub async fn count_start(&self) -> Result<u64, Error> {
        let starts: i64 =
            sqlx::query_scalar("UPDATE counters SET value = value + 1 WHERE name = 'starts' RETURNING value")
                .fetch_one(&self.write)
                .await?;
        Ok(starts as u64)
    }

    /// Stores all rows in one transaction; on return they survive a power cut.
    ///
    /// # Errors
    /// When the disk is full or fails: then none of them is stored.
    pub async fn commit(&self, rows: &[Row]) -> Result<(), Error> {
        let mut tx = self.write.begin().await?;
        for row in rows {
            write(&mut tx, row).await?;
        }
        tx.commit().await?;
        Ok(())
    }
}

fn known_request(id: &str, body: &Digest, known: &str, job: &str) -> Result<Submitted, Error> {
    if known == body.to_string() {
        Ok(Submitted::Known(Box::new(from_json(job)?)))
    } else {
        Err(Error::RequestIdReused(id.to_owned()))
    }
}

async fn write(tx: &mut Transaction<'_, Sqlite>, row: &Row) -> Result<(), Error> {
    let query = match row {
        Row::Job(job) => sqlx::query("UPDATE jobs SET state = $2, revision = $3, job = $4 WHERE id = $1")
            .bind(&job.id)
            .bind(name_of(job.state))
            .bind(job.revision as i64)
            .bind(to_json(job)),
        Row::Frame(job, frame) => {
            sqlx::query("UPDATE frames SET state = $3, details = $4 WHERE job = $1 AND frame = $2")
                .bind(job)
                .bind(frame.frame)
                .bind(name_of(frame.state))
                .bind(to_json(frame))
        }
        Row::Record(job, revision, record) => {
            sqlx::query("INSERT INTO records (job, revision, record) VALUES ($1, $2, $3)")
                .bind(job)
                .bind(*revision as i64)
                .bind(to_json(record))
        }
        Row::Pack { job, frame, round, pack } => insert_pack(job, *frame, *round, pack),
        Row::ReplacePacks { job, frame, round, pack } => {
            forget(tx, "DELETE FROM results WHERE job = $1 AND frame = $2", job, *frame).await?;
            insert_pack(job, *frame, *round, pack)
        }
        Row::Film { job, frame, rounds, film } => {
            forget_all(tx, job, *frame).await?;
            sqlx::query("UPDATE frames SET film = $3, rounds = $4 WHERE job = $1 AND frame = $2")
                .bind(job)
                .bind(frame)
                .bind(film.to_string())
                .bind(i64::from(*rounds))
        }
        Row::Forget(job, frame) => return forget_all(tx, job, *frame).await,
        Row::Lease(lease) => sqlx::query(
            "INSERT INTO leases (fence, worker, job, frame, round, tiles) VALUES ($1, $2, $3, $4, $5, $6)",
        )
        .bind(lease.fence as i64)
        .bind(&lease.worker)
        .bind(&lease.job)
        .bind(lease.frame)
        .bind(i64::from(lease.round))
        .bind(to_json(&lease.tiles)),
        Row::Past(job, frame, round, tile, past) => sqlx::query(
            "INSERT INTO pasts (job, frame, round, tile, past) VALUES ($1, $2, $3, $4, $5) \
             ON CONFLICT (job, frame, round, tile) DO UPDATE SET past = excluded.past",
        )
        .bind(job)
        .bind(frame)
        .bind(i64::from(*round))
        .bind(i64::from(*tile))
        .bind(to_json(past)),
    };
    query.execute(&mut **tx).await?;
    Ok(())
}

/// The same bytes twice are the same pack: nothing to do then.
fn insert_pack<'q>(
    job: &'q str,
    frame: i32,
    round: u32,
    pack: &Digest,
) -> sqlx::query::Query<'q, Sqlite, sqlx::sqlite::SqliteArguments> {
    sqlx::query(
        "INSERT INTO results (job, frame, round, pack) VALUES ($1, $2, $3, $4) ON CONFLICT DO NOTHING",
    )
    .bind(job)
    .bind(frame)
    .bind(i64::from(round))
    .bind(pack.to_string())
}

/// A round of the frame has ended: whatever belonged to it is forgotten.
async fn forget_all(tx: &mut Transaction<'_, Sqlite>, job: &str, frame: i32) -> Result<(), Error> {
    forget(tx, "DELETE FROM results WHERE job = $1 AND frame = $2", job, frame).await?;
    forget(tx, "DELETE FROM leases WHERE job = $1 AND frame = $2", job, frame).await?;
    forget(tx, "DELETE FROM pasts WHERE job = $1 AND frame = $2", job, frame).await
}

async fn forget(
    tx: &mut Transaction<'_, Sqlite>,
    statement: &'static str,
    job: &str,
    frame: i32,
) -> Result<(), Error> {
    sqlx::query(statement).bind(job).bind(frame).execute(&mut **tx).await?;
    Ok(())
}
