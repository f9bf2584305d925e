!> Edge form of the triangle integrals in extended precision.
!>
!> Close to a sliver the contributions of its long edges cancel to the order of
!> its small height, so that working precision loses as many digits as the
!> aspect ratio has. Much slower than hc_edge_form.
module hc_edge_form_extended
  use hc_precision, only: wp
  implicit none
  private

  public :: xp
  public :: edge_form, vertex_loads, twice_area

  !> Thirty digits or more; working precision where the compiler has no such kind.
  integer, parameter :: xp = merge(selected_real_kind(30), wp, selected_real_kind(30) > 0)
  integer, parameter :: rk = xp

contains

  include 'edge_form.inc'

end module hc_edge_form_extended
