"""Files for render farms: the tasks of a job series, in the form each farm reads."""
