"""Files of a job that is at work: kept in folders that say whose they are, so that those of dead processes can go."""
