!> Edge form of the triangle integrals in working precision.
module hc_edge_form
  use hc_precision, only: rk => wp
  implicit none
  private

  public :: edge_form, vertex_loads, twice_area

contains

  include 'edge_form.inc'

end module hc_edge_form
