-- Jobs, their frames, the results of the rounds that are being rendered, and everything watchers were told.
-- Statements keep to what SQLite and Postgres share.

CREATE TABLE jobs (
    number BIGINT NOT NULL PRIMARY KEY,     -- submit order, from 1
    id TEXT NOT NULL UNIQUE,
    request_id TEXT NOT NULL UNIQUE,
    body TEXT NOT NULL,                     -- digest of the request's body
    state TEXT NOT NULL,                    -- karst_server::model::JobState
    revision BIGINT NOT NULL,               -- of the newest record
    files TEXT NOT NULL,                    -- digests of the scene's files by path, as JSON; never changes
    job TEXT NOT NULL                       -- karst_server::model::Job as JSON
);

CREATE TABLE frames (
    job TEXT NOT NULL REFERENCES jobs (id),
    frame INTEGER NOT NULL,
    state TEXT NOT NULL,                    -- karst_server::model::FrameState
    details TEXT NOT NULL,                  -- karst_server::model::Frame as JSON
    film TEXT,                              -- digest of the film after `rounds` rounds; NULL before the first
    rounds BIGINT NOT NULL,
    PRIMARY KEY (job, frame)
);

-- Accepted results of the round that is being rendered: one row per group that was stored together.
CREATE TABLE results (
    job TEXT NOT NULL,
    frame INTEGER NOT NULL,
    round BIGINT NOT NULL,
    pack TEXT NOT NULL,                     -- digest of the blob with these results
    PRIMARY KEY (job, frame, round, pack)
);

CREATE TABLE records (
    job TEXT NOT NULL REFERENCES jobs (id),
    revision BIGINT NOT NULL,
    record TEXT NOT NULL,                   -- karst_server::model::Record as JSON
    PRIMARY KEY (job, revision)
);
