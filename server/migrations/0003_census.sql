-- Jobs and frames are counted by their states whenever metrics are asked for: that must not read all rows.

CREATE INDEX jobs_by_state ON jobs (state);
CREATE INDEX frames_by_state ON frames (state);
