!> Which preconditioner suits a slipping node, by the compliance D of its spring.
!>
!> The elastic compliance of a traction is the greater the longer its waves are: from that of a
!> single node, t_h, for the shortest ones to that of the whole contact. A spring that is
!> softer than all of them leaves 1/D, one that is stiffer than all of them leaves the inverse symbol.
!> In between short waves see the spring and long ones the elastic body: there the
!> inverse symbol is taken of the body on springs of one compliance. The three go over into each other with log D,
!>
!>     M = sqrt(chi_1) T^-1 sqrt(chi_1) + sqrt(chi_2) (T + D_soft)^-1 sqrt(chi_2) + chi_3/D,     sum of chi = 1.
!>
!> Equations: docs/theory/preconditioner.md, (P5), (P6).
module hc_spring_blend
  use hc_precision, only: wp
  use hc_lattice, only: lattice_t
  use hc_elastic_pair, only: elastic_pair_t
  implicit none
  private

  public :: node_compliance, node_ratio, blend, soft, loose

  !> Compliances, over that of a node, up to which a spring counts as stiff, where it counts as soft, and
  !> from where on nothing else counts.
  real(wp), parameter :: stiff = 0.5_wp, soft = 8.0_wp, loose = 64.0_wp

contains

  !> Elastic compliance t_h = 2 lambda_1 (1 + gamma/2) l_e of a node [m/Pa].
  pure real(wp) function node_compliance(lattice, pair)
    !> Lattice
    type(lattice_t), intent(in) :: lattice
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair

    node_compliance = node_ratio(pair)*pair%lambda_1*lattice%spacing()
  end function node_compliance

  !> t_h over lambda_1 and the spacing.
  pure real(wp) function node_ratio(pair)
    !> Elastic constants of the two bodies
    type(elastic_pair_t), intent(in) :: pair

    node_ratio = 2.0_wp + pair%gamma()
  end function node_ratio

  !> sqrt(chi) of the inverse symbols without and with soft springs; the rest of the squares belongs to 1/D.
  pure function blend(ratio) result(weight)
    !> Compliance of the spring over that of the node
    real(wp), intent(in) :: ratio
    real(wp) :: weight(2)
    real(wp) :: share

    if (ratio <= stiff) then
      weight = [1.0_wp, 0.0_wp]
    else if (ratio < soft) then
      share = log(ratio/stiff)/log(soft/stiff)
      weight = sqrt([1.0_wp - share, share])
    else if (ratio < loose) then
      weight = [0.0_wp, sqrt(log(loose/ratio)/log(loose/soft))]
    else
      weight = 0.0_wp
    end if
  end function blend

end module hc_spring_blend
