!> Working precision and the constants every module shares.
module hc_precision
  use, intrinsic :: iso_fortran_env, only: int8, real32, real64
  use, intrinsic :: iso_c_binding, only: c_bool
  implicit none
  private

  public :: wp, sp, xp, lk, zk, pi

  !> Kind of every real in the library; every literal carries it.
  integer, parameter :: wp = real64

  !> Kind of corrections that need a few digits only: half of the memory, half of the time.
  integer, parameter :: sp = real32

  !> Kind of the few sums that cancel: thirty digits or more, or wp where there is none.
  integer, parameter :: xp = merge(selected_real_kind(30), wp, selected_real_kind(30) > 0)

  !> Kind of the marks of nodes: a byte each.
  integer, parameter :: lk = c_bool

  !> Kind of the zones of nodes: a byte each.
  integer, parameter :: zk = int8

  !> Circle constant.
  real(wp), parameter :: pi = 3.14159265358979323846_wp

end module hc_precision
