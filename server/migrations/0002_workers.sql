-- What other processes render: leases, and what has gone wrong with tiles.
-- Statements keep to what SQLite and Postgres share.

-- One row for each lease of a round that is being rendered: says whose results are taken.
CREATE TABLE leases (
    fence BIGINT NOT NULL PRIMARY KEY,      -- rises over all leases, also across restarts
    worker TEXT NOT NULL,
    job TEXT NOT NULL,
    frame INTEGER NOT NULL,
    round BIGINT NOT NULL,
    tiles TEXT NOT NULL                     -- tile indices as JSON
);

CREATE INDEX leases_of_frame ON leases (job, frame);

-- Tiles of the round that is being rendered that did not succeed at once.
CREATE TABLE pasts (
    job TEXT NOT NULL,
    frame INTEGER NOT NULL,
    round BIGINT NOT NULL,
    tile BIGINT NOT NULL,
    past TEXT NOT NULL,                     -- karst_server::past::Past as JSON
    PRIMARY KEY (job, frame, round, tile)
);

-- Whether anything refers to a blob is asked before it is deleted.
CREATE INDEX results_by_pack ON results (pack);
CREATE INDEX frames_by_film ON frames (film);

-- Numbers that only rise.
CREATE TABLE counters (
    name TEXT NOT NULL PRIMARY KEY,
    value BIGINT NOT NULL
);

INSERT INTO counters (name, value) VALUES ('starts', 0);
