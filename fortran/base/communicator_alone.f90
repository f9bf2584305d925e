!> One rank alone: a build without MPI.
submodule (hc_communicator) hc_communicator_alone
  implicit none

contains

  !> Return this process.
  module procedure start_ranks
    ranks = communicator_t()
  end procedure start_ranks

  !> There is nothing to end.
  module procedure end_ranks
    ranks = communicator_t()
  end procedure end_ranks

  !> Return: no other process is to be ended.
  module procedure abort_ranks
  end procedure abort_ranks

  !> Sum the values.
  module procedure total
    total = sum(part)
  end procedure total

  !> The values are the largest.
  module procedure most
  end procedure most

  !> The counts are the sums.
  module procedure add_counts
  end procedure add_counts

  !> The error is that of all.
  module procedure agree
  end procedure agree

  !> No row lies elsewhere; callers copy their own.
  module procedure fetch
  end procedure fetch

  !> The rows are the columns.
  module procedure to_columns
  end procedure to_columns

  !> The columns are the rows.
  module procedure to_rows
  end procedure to_rows

  !> There is no other rank.
  module procedure send_words
  end procedure send_words

  !> No other rank sends anything.
  module procedure wait_for_words
    n = 0
  end procedure wait_for_words

  !> No words come.
  module procedure receive_words
    values = 0
  end procedure receive_words

end submodule hc_communicator_alone
